// Includes, and what was not read. SPDX-License-Identifier: Apache-2.0
#include "document.h"

#include <fmt/format.h>

#include <string_view>

#include "import/folders.h"
#include "import/paths.h"
#include "import/text.h"
#include "import/xml.h"
#include "known.h"
#include "lockstep/error.h"

namespace lockstep::importer::mjcf {

namespace fs = std::filesystem;

namespace {

constexpr int deepest_include = 20;
const char* const wanted = "an MJCF file, <mujoco> ... </mujoco>";

[[noreturn]] void fail(const std::string& place, const std::string& rule, const std::string& remedy) {
  throw ImportError(place, rule, remedy);
}

}  // namespace

Document::Document(const std::string& text, const std::string& source, const std::string& folder,
                   std::vector<fs::path> roots, Report& report)
    : roots_(std::move(roots)), report_(report) {
  parts_.push_back({.folder = folder.empty() ? fs::path() : real_path(folder)});
  const Source& main = load(text, source, folder.empty() ? fs::path() : real_path(source), 0);
  parts_[0].root = main.root;
  const std::string_view tag = root().Name();
  const std::string place = line(root()) + ": <" + shortened(tag) + ">";
  if (tag == "robot") fail(place, "is URDF, not MJCF", "read it by import_urdf_file(), or by import_file()");
  if (tag != "mujoco")
    fail(place, "is no MJCF: the root element is not <mujoco>",
         tag == "mujocoinclude" ? "read the file that includes it" : "convert it to MJCF, or fill a Model in code");
  include_all(main, 0);
  attach_all(0, 0);
}

const Document::Source& Document::load(const std::string& text, const std::string& name, const fs::path& path,
                                       std::size_t part) {
  const auto source = std::make_shared<Source>();
  source->name = name;
  source->path = path;
  source->part = part;
  source->root = &parsed(text, name, wanted, source->xml, report_);
  source->xml.SetUserData(source.get());
  if (!path.empty()) report_.note_file(path.string());
  sources_.push_back(source);
  return *source;
}

std::size_t Document::part_of(const Xml& xml) const {
  return static_cast<const Source*>(xml.GetDocument()->GetUserData())->part;
}

std::string Document::line(const Xml& xml) const {
  return fmt::format("{}:{}", static_cast<const Source*>(xml.GetDocument()->GetUserData())->name, xml.GetLineNum());
}

void Document::include_all(const Source& from, int depth) {
  std::vector<const Xml*> todo = {from.root};
  while (!todo.empty()) {
    const Xml* at = todo.back();
    todo.pop_back();
    for (const Xml* child = at->FirstChildElement(); child; child = child->NextSiblingElement())
      std::string_view(child->Name()) == "include" ? include(*child, from, depth) : todo.push_back(child);
  }
}

fs::path Document::find(const std::string& given, const Xml& element, const Fail& refuse) const {
  const Source& from = *static_cast<const Source*>(element.GetDocument()->GetUserData());
  const fs::path &folder = parts_[from.part].folder, name = given;
  if (folder.empty()) refuse("names a file, which text without a folder cannot", "use import_mjcf_file()");
  if (given.find("://") != std::string::npos) refuse("names no path", "give the path of a file");
  bool leads_out = false;
  for (const fs::path& start : {folder, from.path.parent_path()}) {
    const fs::path path = real_path(start / name);
    std::error_code ignored;
    if (!is_within_any(path, roots_))
      leads_out = true;
    else if (fs::exists(path, ignored))
      return path;
  }
  if (leads_out)
    refuse(fmt::format("leads to '{}', outside of the folders that may be read", shown(real_path(folder / name))),
           "give a folder around it: ImportOptions::file_roots");
  refuse(fmt::format("names '{}', which does not exist", shortened(given)),
         "correct the path, which begins in the folder of the main file");
  return {};
}

const Document::Source& Document::read(const fs::path& path, std::size_t part, const Fail& refuse) {
  const std::string text = text_of(path.string());
  bytes_ += text.size();
  if (bytes_ > largest_file)
    refuse(fmt::format("makes the files larger than {} MB", largest_file >> 20), "give a robot description");
  const fs::path shown = fs::path(sources_[0]->name).parent_path() / fs::relative(path, parts_[0].folder);
  return load(text, shown.string(), path, part);
}

void Document::include(const Xml& element, const Source& from, int depth) {
  const Fail refuse = [&](const std::string& rule, const std::string& remedy) {
    fail(line(element) + ": <include>", rule, remedy);
  };
  const char* given = element.Attribute("file");
  if (!given) refuse("has no attribute 'file'", "name the file to include");
  if (element.FirstChildElement()) refuse("holds elements, which the file takes the place of", "put them beside it");
  const std::string name = name_in("file", given, refuse);
  if (element.Attribute("prefix"))
    refuse("has a prefix, which an include has not", "use <attach>, which gives one to all names of another model");
  if (depth == deepest_include)
    refuse(fmt::format("includes files deeper than {}", deepest_include), "include them nearer to the main file");
  const fs::path path = find(name, element, refuse);
  for (const auto& source : sources_)
    if (source->path == path && source->part == from.part)
      refuse(fmt::format("includes '{}' twice", shortened(name)), "include it once");
  const Source& included = read(path, from.part, refuse);
  const std::string_view tag = included.root->Name();
  if (tag != "mujoco" && tag != "mujocoinclude")
    fail(line(*included.root), "is no MJCF: the root element is not <mujoco> or <mujocoinclude>", "include MJCF");
  included_.emplace(&element, &included);
  include_all(included, depth + 1);
}

std::vector<const Document::Xml*> Document::children(const Xml& owner) const {
  std::vector<const Xml*> found;
  for (const Xml* child = owner.FirstChildElement(); child; child = child->NextSiblingElement()) {
    const auto included = included_.find(child);
    if (included == included_.end()) {
      found.push_back(child);
      continue;
    }
    const std::vector<const Xml*> inside = children(*included->second->root);
    found.insert(found.end(), inside.begin(), inside.end());
  }
  return found;
}

std::vector<const Document::Xml*> Document::inside(std::string_view tag) const {
  std::vector<const Xml*> found;
  for (const Part& part : parts_)
    for (const Xml* xml : children(*part.root)) {
      if (xml->Name() != tag) continue;
      const std::vector<const Xml*> own = children(*xml);
      found.insert(found.end(), own.begin(), own.end());
    }
  return found;
}

std::vector<const Document::Xml*> Document::section(std::string_view tag) {
  for (const Part& part : parts_)
    for (const Xml* xml : children(*part.root))
      if (xml->Name() == tag) visit(*xml);
  return inside(tag);
}

void Document::account(const Xml& element, std::string_view owner) {
  const std::string_view tag = element.Name();
  if (tag == "include") return;
  // Of what is attached, only a body may be taken.
  const auto refuse_misplaced = [&](const Xml& misplaced) {
    if (is_of_mechanism(misplaced.Name()) && part_of(misplaced) == 0)
      fail(line(misplaced) + ": <" + misplaced.Name() + ">", "stands where MJCF has none, so that nobody reads it",
           "move it to where it belongs");
  };
  if (!visited_.contains(&element)) {
    refuse_misplaced(element);
    if (tag == "light" || tag == "camera" || tag == "material")
      for (auto* child = element.FirstChildElement(); child; child = child->NextSiblingElement())
        refuse_misplaced(*child);
    return is_known(tag) ? report_.not_used(std::string(tag)) : report_.unknown(shortened(tag));
  }
  for (auto* attribute = element.FirstAttribute(); attribute; attribute = attribute->Next()) {
    const std::string_view name = attribute->Name();
    if (read_.contains(attribute) || is_for_names(name)) continue;
    const std::string what = fmt::format("'{}' of {}", shortened(name), shortened(tag));
    has_attribute(owner, tag, name) ? report_.not_used(what) : report_.unknown(what);
  }
  if (tag == "replicate" && element.IntAttribute("count", 1) == 0) return report_.not_used("replicate of count 0");
  for (auto* node = element.FirstChild(); node; node = node->NextSibling()) {
    if (const Xml* child = node->ToElement())
      account(*child, tag);
    else if (!node->ToComment())
      report_.unknown(fmt::format("text '{}' in {}", shortened(trimmed(node->Value())), shortened(tag)));
  }
}

void Document::account() {
  for (const auto& source : sources_) {
    visited_.insert(source->root);
    account(*source->root, "");
  }
}

}  // namespace lockstep::importer::mjcf
