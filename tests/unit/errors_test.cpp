// Codes of errors and faults, and the page that lists them. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "lockstep/error.h"

namespace lockstep {
namespace {

// docs/errors.md.
std::string page() {
  std::ostringstream text;
  text
      << "# Errors\n\n"
         "Every error is \"element: rule; remedy\" and has a code. A file that is refused has a line for each reason,\n"
         "and the code of the first. Words may change from version to version, codes do\n"
         "not. The first part is the class: `ModelError`, `ImportError` (`ImportFileError` in Python), "
         "`SettingsError`,\n"
         "`UsageError`. The second, if there is one, is the kind of element that is named.\n\n"
         "| | of an error | of the fault of an environment |\n"
         "| --- | --- | --- |\n"
         "| C++ | `Error::code()` | `code_of(Batch::faults()[e])` |\n"
         "| Python | `error.code` | `batch.fault_report(e)[\"code\"]` |\n"
         "| C | `lockstep_code()` | `lockstep_fault_code()` |\n"
         "| command | `error.code` of `simulate --json` | `first_fault.code` |\n\n"
         "`LOCKSTEP_WRITE_PAGES=1 ctest --preset release -R ErrorPage` writes this page; `src/model/errors.cpp` has "
         "the table.\n\n"
         "| code | what is wrong | what to do |\n"
         "| --- | --- | --- |\n";
  for (const ErrorCode& known : error_codes())
    text << "| `" << known.code << "` | " << known.meaning << " | " << known.remedy << " |\n";
  return text.str();
}

TEST(ErrorPage, is_what_the_table_writes) {
  const std::string path = LOCKSTEP_MODELS "/../../docs/errors.md";
  if (std::getenv("LOCKSTEP_WRITE_PAGES")) std::ofstream(path) << page();
  std::ostringstream committed;
  committed << std::ifstream(path).rdbuf();
  EXPECT_EQ(committed.str(), page());
}

TEST(ErrorCodes, are_different_and_begin_with_a_class) {
  std::set<std::string> seen;
  for (const ErrorCode& known : error_codes()) {
    EXPECT_TRUE(seen.insert(known.code).second) << known.code;
    EXPECT_STRNE(known.meaning, "") << known.code;
    EXPECT_STRNE(known.remedy, "") << known.code;
  }
  for (const std::string& code : seen) {
    const std::string group = code.substr(0, code.find('.'));
    EXPECT_TRUE(group == "fault" || seen.contains(group)) << code;
  }
}

TEST(ErrorCodes, has_every_fault) {
  for (unsigned fault = 1; fault < fault_count; ++fault)
    EXPECT_EQ(code_of(Fault{fault}), std::string("fault.") + to_string(Fault{fault}));
  EXPECT_STREQ(code_of(Fault::none), "");
  EXPECT_STREQ(code_of(Fault{fault_count}), "");
}

// What the library throws has a code. Other exceptions are caught inside of it, and stand here.
TEST(ErrorCodes, stand_behind_whatever_is_thrown) {
  const std::set<std::string> with_codes = {"ModelError", "ImportError", "SettingsError", "UsageError", "Error"};
  const std::set<std::pair<std::string, std::string>> inside = {
      {"model/hull.cpp", "std::invalid_argument"},             // importers and Model::validate() say of what
      {"import/meshes/solid.cpp", "std::invalid_argument"},    // the same
      {"import/meshes/inertia.cpp", "std::invalid_argument"},  // the same
      {"model/shapes.cpp", "std::out_of_range"},               // an enumerator that is none, which Model refuses
      {"import/finish.cpp", "placed"},                         // a function that returns a ModelError
      {"c/handles.h", "std::bad_alloc"},                       // memory
      {"trace/ir.cpp", "std::logic_error"},                    // these are bugs: the tables take the step
      {"trace/tracer.cpp", "std::logic_error"},
      {"jit/places.cpp", "std::logic_error"},
      {"jit/lower.cpp", "std::logic_error"},
      {"jit/lower.cpp", "std::length_error"},
      {"jit/encode.cpp", "std::logic_error"},
      {"codegen/emit_cpp.cpp", "std::logic_error"},
  };
  const std::filesystem::path root = LOCKSTEP_MODELS "/../../src";
  const std::regex thrown("throw ([A-Za-z_:]+)[({]");
  int found = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
    const std::string file = std::filesystem::relative(entry.path(), root).generic_string();
    if (!entry.is_regular_file() || file.starts_with("tool/") || file.starts_with("reference/")) continue;
    std::ostringstream text;
    text << std::ifstream(entry.path()).rdbuf();
    const std::string all = text.str();
    for (std::sregex_iterator at(all.begin(), all.end(), thrown), end; at != end; ++at, ++found)
      EXPECT_TRUE(with_codes.contains((*at)[1]) || inside.contains({file, (*at)[1]})) << file << ": " << (*at)[0];
  }
  EXPECT_GT(found, 200);
}

template <class Kind>
std::string code(const std::string& element) {
  return Kind(element, "rule", "remedy").code();
}

TEST(ErrorCodes, say_what_kind_of_element_is_named) {
  EXPECT_EQ(code<ModelError>("joint 'a'"), "model.joint");
  EXPECT_EQ(code<ModelError>("robots/of joint.urdf:12: link 'joint 7'"), "model.link");
  EXPECT_EQ(code<ModelError>("a coupling"), "model.coupling");
  EXPECT_EQ(code<ModelError>("gravity"), "model");
  EXPECT_EQ(code<ImportError>("arm.urdf:3: joint 'a'"), "import");
  EXPECT_EQ(code<SettingsError>("dt"), "settings.dt");
  EXPECT_EQ(code<SettingsError>("contacts.passes"), "settings.contacts");
  EXPECT_EQ(code<SettingsError>("contact_settings 'quick'"), "settings.contacts");
  EXPECT_EQ(code<SettingsError>("ImportOptions::body"), "settings.import");
  EXPECT_EQ(code<SettingsError>("dtype 'f2'"), "settings.precision");
  EXPECT_EQ(code<SettingsError>("dtail"), "settings");
  EXPECT_EQ(code<UsageError>("section 'fault' of the blob"), "usage.save");
  EXPECT_EQ(code<UsageError>("environment 7"), "usage.environment");
  EXPECT_EQ(code<UsageError>("actions of joint 'a'"), "usage.actions");
  EXPECT_EQ(code<UsageError>("mass of link 'a'"), "usage");
  EXPECT_EQ(code<Error>("joint 'a'"), "internal");
}

}  // namespace
}  // namespace lockstep
