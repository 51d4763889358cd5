// The command's errors, exit codes and subcommands. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>

namespace CLI {
class App;
}

namespace lockstep::tool {

/// Input that cannot be used. what() is one line for the user, without the leading "lockstep: ".
class InputError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

enum ExitCode : int { fine = 0, some_faulted = 1, bad_input = 2 };

/// Each adds its subcommand to `app`. A subcommand that runs writes its exit code to `exit_code`.
void add_info(CLI::App& app, int& exit_code);
void add_simulate(CLI::App& app, int& exit_code);
void add_chart(CLI::App& app, int& exit_code);
void add_view(CLI::App& app, int& exit_code);
void add_generate(CLI::App& app, int& exit_code);
void add_export(CLI::App& app, int& exit_code);

}  // namespace lockstep::tool
