// Includes, and what was not read. SPDX-License-Identifier: Apache-2.0
#include "document.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "import/attributes.h"
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

struct Document::Source {
  std::string name;
  fs::path path;  // canonical; empty for text
  tinyxml2::XMLDocument xml{/*processEntities=*/false};
  const Xml* root = nullptr;
};

Document::Document(const std::string& text, const std::string& source, const std::string& folder, Report& report)
    : folder_(folder.empty() ? fs::path() : real_path(folder)), report_(report) {
  const Source& main = load(text, source, folder.empty() ? fs::path() : real_path(source));
  root_ = main.root;
  const std::string_view tag = root_->Name();
  const std::string place = line(*root_) + ": <" + shortened(tag) + ">";
  if (tag == "robot") fail(place, "is URDF, not MJCF", "read it by import_urdf_file(), or by import_file()");
  if (tag != "mujoco")
    fail(place, "is no MJCF: the root element is not <mujoco>",
         tag == "mujocoinclude" ? "read the file that includes it" : "convert it to MJCF, or fill a Model in code");
  include_all(main, 0);
}

const Document::Source& Document::load(const std::string& text, const std::string& name, const fs::path& path) {
  const auto source = std::make_shared<Source>();
  source->name = name;
  source->path = path;
  source->root = &parsed(text, name, wanted, source->xml, report_);
  source->xml.SetUserData(source.get());
  sources_.push_back(source);
  return *source;
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

void Document::include(const Xml& element, const Source& from, int depth) {
  const std::string place = line(element) + ": <include>";
  const Fail refuse = [&](const std::string& rule, const std::string& remedy) { fail(place, rule, remedy); };
  const char* given = element.Attribute("file");
  if (!given) refuse("has no attribute 'file'", "name the file to include");
  const fs::path name = name_in("file", given, refuse);
  if (folder_.empty()) refuse("includes a file, which text without a folder cannot", "use import_mjcf_file()");
  const char* const inside = "put the file into the folder of the main one, and give its path from there";
  if (name.is_absolute() || name.string().find("://") != std::string::npos)
    refuse("names no path below the main file's folder", inside);
  if (depth == deepest_include)
    refuse(fmt::format("includes files deeper than {}", deepest_include), "include them nearer to the main file");
  std::error_code ignored;
  fs::path path = folder_ / name;
  if (!fs::exists(path, ignored)) path = from.path.parent_path() / name;
  if (!fs::exists(path, ignored))
    refuse(fmt::format("names '{}', which does not exist", shortened(name.string())), inside);
  path = real_path(path);
  if (!is_within(path, folder_)) refuse("leads out of the main file's folder", inside);
  for (const auto& source : sources_)
    if (source->path == path) refuse(fmt::format("includes '{}' twice", shortened(name.string())), "include it once");
  const std::string text = text_of(path.string());
  bytes_ += text.size();
  if (bytes_ > largest_file)
    refuse(fmt::format("makes the files larger than {} MB", largest_file >> 20), "give a robot description");
  const Source& included =
      load(text, (fs::path(sources_[0]->name).parent_path() / fs::relative(path, folder_)).string(), path);
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

std::vector<const Document::Xml*> Document::section(std::string_view tag) {
  std::vector<const Xml*> inside;
  for (const Xml* xml : children(*root_)) {
    if (xml->Name() != tag) continue;
    visit(*xml);
    const std::vector<const Xml*> own = children(*xml);
    inside.insert(inside.end(), own.begin(), own.end());
  }
  return inside;
}

void Document::account(const Xml& element) {
  const std::string_view tag = element.Name();
  if (tag == "include") return;
  if (!visited_.contains(&element))
    return is_known(tag) ? report_.not_used(std::string(tag)) : report_.unknown(shortened(tag));
  for (auto* attribute = element.FirstAttribute(); attribute; attribute = attribute->Next()) {
    const std::string_view name = attribute->Name();
    if (read_.contains(attribute) || is_for_names(name)) continue;
    const std::string what = fmt::format("'{}' of {}", shortened(name), shortened(tag));
    is_known(name) ? report_.not_used(what) : report_.unknown(what);
  }
  for (auto* node = element.FirstChild(); node; node = node->NextSibling()) {
    if (const Xml* child = node->ToElement())
      account(*child);
    else if (!node->ToComment())
      report_.unknown(fmt::format("text '{}' in {}", shortened(trimmed(node->Value())), shortened(tag)));
  }
}

void Document::account() {
  visited_.insert(root_);
  for (const auto& source : sources_) {
    if (source->root != root_) visited_.insert(source->root);
    account(*source->root);
  }
}

}  // namespace lockstep::importer::mjcf
