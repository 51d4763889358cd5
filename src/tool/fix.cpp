// Takes all options that messages name, then leaves out what is not needed. SPDX-License-Identifier: Apache-2.0
#include "fix.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <optional>
#include <string_view>
#include <utility>

namespace lockstep::tool {
namespace {

constexpr std::size_t most_options = 40;

struct Option {
  const char* member;    // of ImportOptions, as messages name it
  const char* argument;  // NAME stands for the element that the message names
  const char* value;     // likewise; null for a flag
};

// Those that assume less come first.
constexpr Option all_options[] = {{"leave_out_foreign", "--leave-out-foreign", nullptr},
                                  {"ignore", "--ignore", "position_limits:NAME"},
                                  {"density", "--density", "1000"},
                                  {"fit_of_links", "--fit-of-links", "NAME=none"},
                                  {"leave_out_meshes", "--leave-out-meshes", nullptr},
                                  {"repair_inertias", "--repair-inertias", nullptr},
                                  {"least_mass", "--least-mass", "0.01"},
                                  {"least_inertia", "--least-inertia", "1e-5"}};

// "joint 'elbow'" -> "elbow"
std::string named_in(const std::string& element) {
  const std::size_t begin = element.rfind(" '") + 2, end = element.rfind('\'');
  return begin < 2 || end == std::string::npos || end < begin ? "" : element.substr(begin, end - begin);
}

Arguments arguments_of(const Option& option, const std::string& name) {
  Arguments words{option.argument};
  if (!option.value) return words;
  std::string value = option.value;
  if (const std::size_t at = value.find("NAME"); at != std::string::npos) value.replace(at, 4, name);
  words.push_back(std::move(value));
  return words;
}

using Options = std::vector<Arguments>;

Arguments joined(const Options& options) {
  Arguments all;
  for (const Arguments& words : options) all.insert(all.end(), words.begin(), words.end());
  return all;
}

// The first option that the reason names and that is not among those tried.
std::optional<Arguments> untried(const Reason& reason, const Options& tried) {
  for (const Option& option : all_options) {
    if (reason.remedy.find(std::string("ImportOptions::") + option.member) == std::string::npos) continue;
    Arguments words = arguments_of(option, named_in(reason.element));
    if (std::find(tried.begin(), tried.end(), words) == tried.end()) return words;
  }
  return std::nullopt;
}

// Why the file is refused with these options; nothing if it is read. What no option can help has no reasons.
std::optional<std::vector<Reason>> refused(ModelOptions options, Ignored ignore, const Options& tried) {
  try {
    take(joined(tried), options, ignore);
    options.read(ignore);
    return std::nullopt;
  } catch (const Error& error) {
    return error.reasons();
  } catch (const std::exception&) {
    return std::vector<Reason>();
  }
}

}  // namespace

Arguments fixing_arguments(const ModelOptions& options, const Ignored& ignore, const Error& refusal) {
  Options tried;
  for (std::optional<std::vector<Reason>> reasons = refusal.reasons(); reasons;
       reasons = refused(options, ignore, tried)) {
    const std::size_t before = tried.size();
    for (const Reason& reason : *reasons)
      if (std::optional<Arguments> words = untried(reason, tried)) tried.push_back(std::move(*words));
    if (tried.size() == before || tried.size() > most_options) return {};
  }
  for (bool is_shorter = true; std::exchange(is_shorter, false);)
    for (std::size_t i = tried.size(); i-- > 0;) {
      Options without = tried;
      without.erase(without.begin() + static_cast<std::ptrdiff_t>(i));
      if (refused(options, ignore, without)) continue;
      tried = std::move(without);
      is_shorter = true;
    }
  return joined(tried);
}

void take(const Arguments& arguments, ModelOptions& options, Ignored& ignore) {
  CLI::App app;
  ModelOptions taken = options;
  taken.add_to(app);
  Ignored ignored = ignore;
  add_ignore(app, ignored);
  Arguments words(arguments.rbegin(), arguments.rend());  // as CLI11 wants them
  words.push_back(options.file);
  app.parse(words);
  options = std::move(taken);
  ignore = std::move(ignored);
}

std::string shell_words(const Arguments& words) {
  constexpr std::string_view plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_=+:,./@%";
  std::string line;
  for (const std::string& word : words) {
    if (!line.empty()) line += ' ';
    if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) {
      line += word;
      continue;
    }
    line += '\'';
    for (const char c : word) c == '\'' ? line += "'\\''" : line += c;
    line += '\'';
  }
  return line;
}

}  // namespace lockstep::tool
