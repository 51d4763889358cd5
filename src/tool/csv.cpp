// SPDX-License-Identifier: Apache-2.0
#include "csv.h"

#include <fmt/format.h>

#include <set>
#include <sstream>

#include "files/regular_file.h"
#include "text.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

constexpr std::size_t most_bytes = std::size_t{256} << 20;  // as for a URDF file

// The fields of one line. A quote inside a quoted field stands twice.
std::vector<std::string> fields(const std::string& line, const std::string& where) {
  std::vector<std::string> result(1);
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (c == '"' && quoted && i + 1 < line.size() && line[i + 1] == '"') {
      result.back() += line[++i];
    } else if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      result.emplace_back();
    } else {
      result.back() += c;
    }
  }
  if (quoted) throw InputError(where + ": a quote is opened and not closed");
  return result;
}

std::string without_blanks_around(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t");
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

void read_header(const std::vector<std::string>& names, const std::string& where, Table& table) {
  std::set<std::string> seen;
  for (const std::string& name : names) {
    table.columns.push_back(without_blanks_around(name));
    const std::string cell = fmt::format("{}:{}", where, table.columns.size());
    if (table.columns.back().empty()) throw InputError(cell + ": the column has no name");
    if (!seen.insert(table.columns.back()).second)
      throw InputError(fmt::format("{}: column '{}' appears twice", cell, table.columns.back()));
  }
}

void read_row(const std::vector<std::string>& cells, int line, const std::string& where, Table& table) {
  if (cells.size() != table.columns.size())
    throw InputError(
        fmt::format("{}: the row has {} fields, the header has {}", where, cells.size(), table.columns.size()));
  std::vector<double> row;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const std::optional<double> number = to_number(cells[i]);
    if (!number)
      throw InputError(
          fmt::format("{}:{}: '{}' in column '{}' is not a finite number", where, i + 1, cells[i], table.columns[i]));
    row.push_back(*number);
  }
  table.rows.push_back(std::move(row));
  table.lines.push_back(line);
}

}  // namespace

std::string Table::at(std::size_t row, std::size_t column) const {
  return fmt::format("{}:{}:{}", file, lines.at(row), column + 1);
}

std::string text_of(const std::string& path) {
  return files::content_of(path, most_bytes, [&](const std::string& rule, const std::string& remedy) {
    throw InputError(fmt::format("{}: {}; {}", path, rule, remedy));
  });
}

Table read_csv(const std::string& path) { return parse_csv(text_of(path), path); }

Table parse_csv(const std::string& text, const std::string& file) {
  Table table;
  table.file = file;
  if (text.find('\0') != std::string::npos)
    throw InputError(file + ": holds zero bytes, as UTF-16 has them; save it as UTF-8");
  std::istringstream stream(text.starts_with("\xEF\xBB\xBF") ? text.substr(3) : text);  // a byte order mark
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    if (line.ends_with('\r')) line.pop_back();
    if (without_blanks_around(line).empty()) continue;
    const std::string where = fmt::format("{}:{}", file, number);
    if (table.columns.empty())
      read_header(fields(line, where), where, table);
    else
      read_row(fields(line, where), number, where, table);
  }
  if (table.rows.empty()) throw InputError(file + ": has no rows; the first line names the columns, numbers follow");
  return table;
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

}  // namespace lockstep::tool
