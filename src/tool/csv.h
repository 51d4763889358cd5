// Tables of numbers in CSV files. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace lockstep::tool {

/// A CSV file whose first line names the columns and whose other cells are finite numbers.
struct Table {
  std::string file;                       ///< its name in errors
  std::vector<std::string> columns;       ///< their names: all different, none empty
  std::vector<std::vector<double>> rows;  ///< as wide as the header
  std::vector<int> lines;                 ///< by row: its line in the file, from 1

  /// "file:line:column" of a cell (all from 1), for errors.
  std::string at(std::size_t row, std::size_t column) const;
};

/// The text of a regular file. Throws InputError, for more than 256 MB too.
std::string text_of(const std::string& path);

/// Reads a table: commas, optional "quoted" fields, any line ends; blank lines are skipped. There must be a row.
/// Throws InputError, with file:line:column where something is not a finite number, and as text_of() does.
Table read_csv(const std::string& path);
Table parse_csv(const std::string& text, const std::string& file);

/// The text as a CSV field: in quotes where it holds a comma, a quote or a line end.
std::string csv_field(const std::string& text);

}  // namespace lockstep::tool
