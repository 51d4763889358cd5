// <attach>: other models, with a prefix before all of their names. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <filesystem>

#include "document.h"
#include "import/text.h"
#include "lockstep/error.h"
#include "references.h"

namespace lockstep::importer::mjcf {

namespace fs = std::filesystem;

namespace {

constexpr int deepest_attach = 20;
constexpr std::size_t most_parts = 1000;

using Xml = tinyxml2::XMLElement;

// What makes bodies or stands around them.
bool holds_bodies(std::string_view tag) {
  return tag == "worldbody" || tag == "body" || tag == "frame" || tag == "replicate";
}

void collect_attaches(const Document& document, const Xml& owner, std::vector<const Xml*>& found) {
  for (const Xml* child : document.children(owner)) {
    if (std::string_view(child->Name()) == "attach") found.push_back(child);
    if (holds_bodies(child->Name())) collect_attaches(document, *child, found);
  }
}

// What stands around it is visited: it has no effect but by its childclass.
const Xml* find_body(Document& document, const Xml& owner, std::string_view name, std::string& childclass) {
  for (const Xml* child : document.children(owner)) {
    if (!holds_bodies(child->Name())) continue;
    const char* own = child->Attribute("name");
    if (own && own == name && std::string_view(child->Name()) == "body") return child;
    std::string inner = child->Attribute("childclass") ? child->Attribute("childclass") : childclass;
    if (const Xml* found = find_body(document, *child, name, inner)) {
      document.visit(*child);
      childclass = inner;
      return found;
    }
  }
  return nullptr;
}

// A mesh, height field or picture without a name has that of its file.
void name_by_file(Xml& xml) {
  const std::string_view tag = xml.Name();
  if ((tag != "mesh" && tag != "hfield" && tag != "texture") || xml.Attribute("name") || !xml.Attribute("file")) return;
  xml.SetAttribute("name", fs::path(xml.Attribute("file")).stem().c_str());
}

// Classes keep their names: each part has its own.
void add_prefix_to(Xml& xml, const std::string& prefix) {
  const std::string_view tag = xml.Name();
  if (tag == "default" || tag == "attach" || tag == "model") return;
  name_by_file(xml);
  for (auto* attribute = xml.FirstAttribute(); attribute; attribute = attribute->Next()) {
    const std::string_view name = attribute->Name(), kind = referent(name);
    const bool is_world = kind == "body" && std::string_view(attribute->Value()) == "world";
    if ((name != "name" && kind.empty()) || !*attribute->Value() || is_world) continue;
    xml.SetAttribute(attribute->Name(), (prefix + attribute->Value()).c_str());
  }
}

}  // namespace

void Document::attach_all(std::size_t part, int depth) {
  std::vector<const Xml*> found;
  if (const Xml* body = parts_[part].body)
    collect_attaches(*this, *body, found);
  else
    collect_attaches(*this, *parts_[part].root, found);
  for (const Xml* element : found) attach(*element, depth);
}

void Document::attach(const Xml& element, int depth) {
  const Fail refuse = [&](const std::string& rule, const std::string& remedy) {
    throw ImportError(line(element) + ": <attach>", rule, remedy);
  };
  const auto required = [&](const char* attribute) -> std::string {
    const char* text = element.Attribute(attribute);
    if (!text) refuse(fmt::format("has no attribute '{}'", attribute), fmt::format("write {}=\"...\"", attribute));
    return *text ? name_in(attribute, text, refuse) : "";
  };
  const std::string model = required("model"), prefix = required("prefix");
  if (depth == deepest_attach)
    refuse(fmt::format("attaches models deeper than {}", deepest_attach), "see that none attaches itself");
  if (parts_.size() > most_parts)
    refuse(fmt::format("makes more than {} models", most_parts), "see that none attaches itself");
  const std::size_t around = part_of(element), number = parts_.size();
  const Source& source = load_attached(element, model, refuse);
  parts_.push_back(
      {.root = source.root, .prefix = parts_[around].prefix + prefix, .folder = source.path.parent_path()});
  attached_.emplace(&element, number);
  if (std::string_view(source.root->Name()) != "mujoco")
    refuse(fmt::format("attaches model '{}', which is no MJCF", shortened(model)), "attach a <mujoco> file");
  include_all(source, 0);
  add_prefix(number);
  if (const char* body = element.Attribute("body")) choose_body(parts_[number], name_in("body", body, refuse), refuse);
  attach_all(number, depth + 1);
}

// A <model> without a name has that of its file's root element.
const Document::Source& Document::load_attached(const Xml& element, const std::string& model, const Fail& refuse) {
  const std::size_t around = part_of(element), number = parts_.size();
  std::vector<std::string> names;
  for (const Xml* section : children(*parts_[around].root)) {
    if (std::string_view(section->Name()) != "asset") continue;
    visit(*section);
    for (const Xml* xml : children(*section)) {
      if (std::string_view(xml->Name()) != "model") continue;
      const Fail refuse_model = [&](const std::string& rule, const std::string& remedy) {
        throw ImportError(line(*xml) + ": <model>", rule, remedy);
      };
      const char *name = xml->Attribute("name"), *file = xml->Attribute("file");
      if (!file) refuse_model("has no attribute 'file'", "name the file to attach");
      visit(*xml);
      for (auto* attribute = xml->FirstAttribute(); attribute; attribute = attribute->Next())
        if (std::string_view(attribute->Name()) == "file") note_read(*attribute);
      if (name) names.emplace_back(name);
      if (name && name != model) continue;
      const Source& source = read(find(name_in("file", file, refuse_model), *xml, refuse_model), number, refuse_model);
      const char* own = source.root->Attribute("model");
      if (name || (own && own == model)) return source;
      names.emplace_back(own ? own : "");
      sources_.pop_back();
    }
  }
  const std::string meant = nearest(model, names);
  refuse(fmt::format("names model '{}', which no <model> of <asset> has", shortened(model)),
         meant.empty() ? "add <model name=\"...\" file=\"...\"/> to <asset>"
                       : fmt::format("correct the name: '{}' exists", shortened(meant)));
  return *sources_[0];
}

void Document::add_prefix(std::size_t part) {
  for (const auto& source : sources_) {
    if (source->part != part) continue;
    std::vector<Xml*> todo;
    for (Xml* child = source->root->FirstChildElement(); child; child = child->NextSiblingElement())
      todo.push_back(child);
    while (!todo.empty()) {
      Xml& at = *todo.back();
      todo.pop_back();
      add_prefix_to(at, parts_[part].prefix);
      for (Xml* child = at.FirstChildElement(); child; child = child->NextSiblingElement()) todo.push_back(child);
    }
  }
}

void Document::choose_body(Part& part, const std::string& name, const Fail& refuse) {
  part.body = find_body(*this, *part.root, part.prefix + name, part.childclass);
  if (!part.body)
    refuse(fmt::format("names body '{}', which the model does not have", shortened(name)),
           "name a body of it, or none for its whole world");
}

}  // namespace lockstep::importer::mjcf
