// What the command writes: files, and lines for people. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

namespace lockstep::tool {

/// Throws InputError if an output is also an input or another output. Empty names do not count.
void keep_apart(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs);

/// Throws InputError where a file of this name could not be written, without touching it. For outputs that are opened
/// when there is something to write. An empty name is none.
void require_writable(const std::string& path);

/// A text file to write. Every failure to write, such as a full disk, throws InputError.
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

/// Opens what is closed of standard input, output and errors. Otherwise the next file would take their number, and
/// would get what is printed.
void open_standard_streams();

/// Whether all that was printed has been written, which a full disk and a closed output prevent.
bool is_output_written();

/// "lockstep: " and the message as one line, which scripts can read, on standard errors; as far as it can be written.
void to_stderr(std::string message);

}  // namespace lockstep::tool
