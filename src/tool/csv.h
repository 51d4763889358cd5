// Tables of numbers in CSV files. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

namespace lockstep::tool {

/// A CSV file whose first line names the columns and whose other cells are finite numbers.
struct Table {
  std::string file;                       ///< as errors name it
  std::vector<std::string> columns;       ///< all different, none empty
  std::vector<std::vector<double>> rows;  ///< as wide as the header
  std::vector<int> lines;                 ///< by row: its line in the file, from 1

  /// "file:line:column" of a cell (all from 1), for errors.
  std::string at(std::size_t row, std::size_t column) const;
};

/// Reads such a file: commas, optional "quoted" fields, any line ends, blank lines skipped. At least one row.
/// Throws InputError with file:line:column where something is no number.
Table read_csv(const std::string& path);
Table parse_csv(const std::string& text, const std::string& file);

/// A field as CSV wants it: in quotes where it holds a comma, a quote or a line end.
std::string csv_field(const std::string& text);

/// Throws InputError where writing an output would overwrite an input or another output. Empty names are none.
void keep_apart(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs);

/// A text file being written. Nothing is lost silently: a full disk throws InputError.
class OutputFile {
 public:
  /// Throws InputError where the file cannot be written.
  explicit OutputFile(std::string path);
  void write(const std::string& text);
  void close();

 private:
  [[noreturn]] void fail() const;
  std::string path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

}  // namespace lockstep::tool
