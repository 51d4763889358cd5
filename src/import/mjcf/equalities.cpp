// <equality>. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "scene.h"

namespace lockstep::importer::mjcf {
namespace {

class Reader {
 public:
  explicit Reader(Scene& scene) : scene_(scene) {}

  void read(const Element::Xml& xml) {
    Element element = scene_.classes.element(xml, "", "equality");
    const std::string tag = element.tag();
    element.rename(element.has("name") ? fmt::format("{} '{}'", tag, element.name("name"))
                                       : fmt::format("equality <{}>", shortened(tag)));
    if (!element.truth("active", true) || !scene_.settings.has_equalities)
      return scene_.report().warn("equalities that are not active, left out", element.place());
    if (tag == "connect" || tag == "weld") return judge_loop(element);
    if (tag != "joint" && tag != "tendon")
      element.fail("is an equality that lockstep lacks", "remove it, or set active=\"false\"");
    Equality equality;
    equality.place = element.place();
    equality.name = element.title();
    element.numbers("solref", equality.solref, 1, 2);
    element.numbers("solimp", equality.solimp, 1, 5);
    double poly[5] = {0.0, 1.0, 0.0, 0.0, 0.0};
    element.numbers("polycoef", poly, 1, 5);
    if (std::any_of(poly + 2, poly + 5, [](double x) { return x != 0.0; }))
      element.fail("is not linear: one of the last three of polycoef is not 0", "linearise it, or set these to 0");
    if (tag == "joint" ? couple_joints(element, poly, equality.form) : couple_tendons(element, poly, equality.form))
      scene_.equalities.push_back(std::move(equality));
    else
      scene_.report().warn("equalities of bodies left out, left out", element.place());
  }

 private:
  // y - y0 = a0 + a1 (x - x0), where 0 stands for the drawn pose.
  bool couple_joints(const Element& element, const double* poly, Form& form) const {
    const int follower = scene_.scalar_joint(element.name("joint1"), element);
    const bool has_leader = element.has("joint2");
    const int leader = has_leader ? scene_.scalar_joint(element.name("joint2"), element) : -1;
    if (follower < 0 || (has_leader && leader < 0)) return false;
    form.add(follower, 1.0);
    form.constant = -scene_.joint(follower).ref - poly[0];
    if (!has_leader) return true;
    if (follower == leader) element.fail("couples a joint to itself", "name two joints");
    form.add(leader, -poly[1]);
    form.constant += poly[1] * scene_.joint(leader).ref;
    return true;
  }

  bool couple_tendons(const Element& element, const double* poly, Form& form) const {
    const auto add = [&](const char* attribute, double factor) {
      const std::string name = element.name(attribute);
      const auto tendon = std::find_if(scene_.tendons.begin(), scene_.tendons.end(),
                                       [&](const Tendon& candidate) { return candidate.name == name; });
      if (tendon == scene_.tendons.end())
        element.fail(fmt::format("names tendon '{}', which does not exist", shortened(name)), "correct the name");
      if (tendon->is_spatial)
        element.fail(fmt::format("holds tendon '{}', which is spatial: that is not linear", shortened(name)),
                     "use fixed tendons, or set active=\"false\"");
      for (const auto& [joint, coefficient] : tendon->length.terms) {
        form.add(joint, factor * coefficient);
        form.constant -= factor * coefficient * scene_.joint(joint).ref;
      }
      return tendon->is_whole;
    };
    form.constant = -poly[0];
    bool is_whole = add("tendon1", 1.0);
    if (element.has("tendon2")) is_whole = add("tendon2", -poly[1]) && is_whole;
    return is_whole;
  }

  // The body of one end; 0 for the world, and where the name is not that of a body or site.
  int end(const Element& element, const char* body, const char* site) const {
    if (element.has(site)) {
      const std::string name = element.name(site);
      for (std::size_t b = 0; b < scene_.bodies.all.size(); ++b)
        for (const SitePart& part : scene_.bodies.all[b].sites)
          if (part.name == name) return static_cast<int>(b);
      return 0;
    }
    const auto found = scene_.body_of.find(element.name(body, "world"));
    return found == scene_.body_of.end() ? 0 : found->second;
  }

  void judge_loop(const Element& element) const {
    const int ends[] = {end(element, "body1", "site1"), end(element, "body2", "site2")};
    bool moves = false;
    for (const int body : ends)
      moves = moves ||
              (scene_.bodies.moves[static_cast<std::size_t>(body)] && scene_.is_read[static_cast<std::size_t>(body)]);
    if (!moves)
      return scene_.report().remark("closed loops of bodies that do not move or are left out, without effect",
                                    element.place());
    if (scene_.options.loops == Loops::leave_out) {
      scene_.report().show_all("closed loops, left out on request");
      return scene_.report().warn("closed loops, left out on request", element.place());
    }
    element.fail("closes a loop, and lockstep models trees",
                 "remove it, or leave all loops out: ImportOptions::loops leave_out");
  }

  Scene& scene_;
};

}  // namespace

void read_equalities(Scene& scene) {
  for (const Element::Xml* xml : scene.document.section("equality")) Reader(scene).read(*xml);
}

}  // namespace lockstep::importer::mjcf
