// The lockstep command: info, simulate, chart, view, generate, export. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <new>

#include "fix.h"
#include "lockstep/version.h"
#include "output.h"
#include "text.h"
#include "tool.h"

namespace {

int complain(std::string message) {
  lockstep::tool::to_stderr(std::move(message));
  return lockstep::tool::bad_input;
}

// A line for each reason, and one for the command that reads the file.
int complain(const lockstep::Error& error, const lockstep::tool::Arguments& command) {
  using namespace lockstep::tool;
  for (const lockstep::Reason& reason : error.reasons())
    complain(with_own_options(fmt::format("{}: {}; {}", reason.element, reason.rule, reason.remedy)));
  const auto* fix = dynamic_cast<const Fix*>(&error);
  if (fix && !fix->arguments.empty())
    complain(fmt::format("it is read by: {} {}", shell_words(command), shell_words(fix->arguments)));
  return bad_input;
}

int run(int argc, char** argv) {
  using namespace lockstep::tool;
  CLI::App app("Steps thousands of identical mechanisms with mimic joints at once.", "lockstep");
  app.set_version_flag("--version", std::string("lockstep ") + lockstep::version());
  app.get_formatter()->column_width(36);
  int exit_code = fine;
  add_info(app, exit_code);
  add_simulate(app, exit_code);
  add_chart(app, exit_code);
  add_view(app, exit_code);
  add_generate(app, exit_code);
  add_export(app, exit_code);
  app.require_subcommand(0, 1);
  app.allow_extras();  // a misspelt command is named below
  try {
    app.parse(argc, argv);
    const std::vector<std::string> extras = app.remaining();
    if (!extras.empty())
      return complain(
          fmt::format("there is no command '{}'; give info, simulate, chart, view, generate or export", extras[0]));
    if (app.get_subcommands().empty())
      return complain("give a command: info, simulate, chart, view, generate or export; see --help");
    return exit_code;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    return complain(error.what());
  } catch (const std::bad_alloc&) {
    return complain("not enough memory; ask for fewer environments");
  } catch (const lockstep::Error& error) {
    return complain(error, Arguments(argv, argv + argc));
  } catch (const std::exception& error) {  // InputError
    return complain(error.what());
  }
}

}  // namespace

int main(int argc, char** argv) {
  lockstep::tool::open_standard_streams();
  const int status = run(argc, argv);
  if (lockstep::tool::is_output_written() || status == lockstep::tool::bad_input) return status;
  return complain("standard output cannot be written; what was printed is lost");
}
