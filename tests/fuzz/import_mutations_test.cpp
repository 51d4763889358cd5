// Every damaged file is either read or refused with a lockstep::Error. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "lockstep/error.h"
#include "lockstep/import.h"

namespace lockstep {
namespace {

using std::string;

constexpr int mutants_per_file = 1000;

struct File {
  string name, text;
};

// The files of a folder, sorted by name, so that the seed of a failure means the same everywhere.
std::vector<File> files(const string& folder, const string& extension) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == extension) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  std::vector<File> result;
  for (const auto& path : paths) {
    std::ifstream stream(path, std::ios::binary);
    result.push_back({path.filename(), string(std::istreambuf_iterator<char>(stream), {})});
  }
  return result;
}

class Damage {
 public:
  explicit Damage(unsigned seed) : random_(seed) {}

  string operator()(string text) {
    const std::size_t times = below(3) ? 1 : 1 + below(4);
    for (std::size_t i = 0; i < times && !text.empty(); ++i) (this->*kinds[below(std::size(kinds))])(text);
    return text;
  }

 private:
  // The numbers of std::uniform_int_distribution would differ from library to library.
  std::size_t below(std::size_t bound) { return bound ? random_() % bound : 0; }

  void flip(string& text) { text[below(text.size())] ^= static_cast<char>(1u << below(8)); }
  void truncate(string& text) { text.resize(below(text.size())); }
  void erase(string& text) { text.erase(below(text.size()), 1 + below(40)); }
  void duplicate(string& text) {
    const string chunk = text.substr(below(text.size()), 1 + below(400));
    text.insert(below(text.size()), chunk);
  }

  // Replaces a quoted value by another one of the file, or by a nasty one.
  void swap_values(string& text) { replace_value(text, value_of(text)); }
  void spoil_value(string& text) {
    static const string nasty[] = {"",        "nan",     "-inf", "1e308", "-1e308", "1e-310",          "0",
                                   "1 2 3 4", "base",    "&lt;", "%s",    "0x7f",   string(5000, '9'), "-0",
                                   "fixed",   "knuckle", "-1",   "1e200", "{}",     "floating",        "continuous"};
    replace_value(text, nasty[below(std::size(nasty))]);
  }

  // Moves the text from a '<' up to the next "/>" to another place between elements.
  void move_element(string& text) {
    const std::size_t from = text.find('<', below(text.size()));
    if (from == string::npos) return;
    const std::size_t end = std::min(text.find("/>", from), text.size() - 2) + 2;
    const string element = text.substr(from, end - from);
    text.erase(from, end - from);
    text.insert(std::min(text.find('<', below(text.size())), text.size()), element);
  }

  string value_of(const string& text) {
    const auto [begin, end] = value_at(text);
    return text.substr(begin, end - begin);
  }
  void replace_value(string& text, const string& value) {
    const auto [begin, end] = value_at(text);
    text.replace(begin, end - begin, value);
  }
  std::pair<std::size_t, std::size_t> value_at(const string& text) {
    const std::size_t equals = text.find("=\"", below(text.size()));
    if (equals == string::npos) return {0, 0};
    return {equals + 2, std::min(text.find('"', equals + 2), text.size())};
  }

  static constexpr void (Damage::*kinds[])(string&) = {
      &Damage::flip,        &Damage::truncate,    &Damage::erase,       &Damage::duplicate,    &Damage::swap_values,
      &Damage::swap_values, &Damage::spoil_value, &Damage::spoil_value, &Damage::move_element, &Damage::flip};
  std::mt19937 random_;
};

// Reads mutants of all files, or sees them refused.
template <class Read>
void expect_read_or_refused(const std::vector<File>& files, Read read_text) {
  int read = 0, refused = 0;
  unsigned seed = 0;
  for (const File& file : files)
    for (int i = 0; i < mutants_per_file; ++i, ++seed) {
      const string text = Damage(seed)(file.text);
      try {
        const Import import = read_text(text, file.name);
        ASSERT_NO_THROW(import.model.validate()) << file.name << ", seed " << seed;
        ASSERT_FALSE(import.report.empty());
        ++read;
      } catch (const Error& error) {
        ASSERT_FALSE(error.element().empty() || error.rule().empty() || error.remedy().empty()) << error.what();
        ++refused;
      } catch (const std::exception& error) {
        FAIL() << file.name << ", seed " << seed << ": " << error.what() << "\n" << text;
      }
    }
  // Damage that is always or never refused would test only half of the reader.
  EXPECT_GT(read, static_cast<int>(seed) / 10);
  EXPECT_GT(refused, static_cast<int>(seed) / 10);
  testing::Test::RecordProperty("read", read);
  testing::Test::RecordProperty("refused", refused);
}

TEST(ImportMutations, every_damaged_file_is_read_or_refused_by_name) {
  expect_read_or_refused(files(LOCKSTEP_MODELS, ".urdf"),
                         [](const string& text, const string& name) { return import_urdf(text, name); });
}

TEST(ImportMutations, every_damaged_mjcf_file_is_read_or_refused_by_name) {
  expect_read_or_refused(files(LOCKSTEP_MODELS "/../mjcf/models", ".xml"), [](const string& text, const string& name) {
    return import_mjcf(text, name, {.colliders = true, .loops = Loops::leave_out, .leave_out_meshes = true});
  });
}

}  // namespace
}  // namespace lockstep
