// Codes of errors and faults, and the page that lists them. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
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
         "`LOCKSTEP_WRITE_PAGES=1 ctest -R ErrorPage` writes this page; `src/model/errors.cpp` has the table.\n\n"
         "| code | what is wrong |\n"
         "| --- | --- |\n";
  for (const ErrorCode& known : error_codes()) text << "| `" << known.code << "` | " << known.meaning << " |\n";
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
