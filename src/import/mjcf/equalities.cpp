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
    if (tag == "connect" || tag == "weld") return scene_.closures.push_back(std::move(element));
    if (tag != "joint" && tag != "tendon")
      element.fail("is an equality that lockstep lacks", "remove it, or set active=\"false\"");
    double poly[5] = {0.0, 1.0, 0.0, 0.0, 0.0};
    element.numbers("polycoef", poly, 1, 5);
    Equality equality{element.place(), element.title(), {}, yielding_of(element, "solref", "solimp")};
    if (tag == "joint" ? couple_joints(element, poly, equality) : couple_tendons(element, poly, equality.form)) {
      if (!equality.form.terms.empty()) scene_.equalities.push_back(std::move(equality));
    } else {
      scene_.report().warn("equalities of bodies left out, left out", element.place());
    }
  }

 private:
  static bool is_linear(const double* poly) {
    return std::all_of(poly + 2, poly + 5, [](double x) { return x == 0.0; });
  }

  // y - y0 = a0 + a1 (x - x0) + a2 (x - x0)^2 + ..., where x0 and y0 are those of the drawn pose. What is not linear
  // becomes a curve in place of a form.
  bool couple_joints(const Element& element, const double* poly, Equality& equality) {
    const int follower = scene_.scalar_joint(element.name("joint1"), element);
    const bool has_leader = element.has("joint2");
    const int leader = has_leader ? scene_.scalar_joint(element.name("joint2"), element) : -1;
    if (follower < 0 || (has_leader && leader < 0)) return false;
    if (has_leader && follower == leader) element.fail("couples a joint to itself", "name two joints");
    const double from = scene_.joint(follower).ref;
    if (has_leader && !is_linear(poly)) {
      scene_.curves.push_back(
          {equality.place, follower, leader, expanded(poly, scene_.joint(leader).ref, from), equality.yielding});
      return true;
    }
    equality.form.add(follower, 1.0);
    equality.form.constant = -from - poly[0];
    if (!has_leader) return true;
    equality.form.add(leader, -poly[1]);
    equality.form.constant += poly[1] * scene_.joint(leader).ref;
    return true;
  }

  // value + sum of a_i (x - at)^i, in powers of x.
  static Polynomial expanded(const double* poly, double at, double value) {
    std::vector<double> coefficients{poly[4]};
    for (int i = 3; i >= 0; --i) {
      coefficients.insert(coefficients.begin(), poly[i]);
      for (std::size_t k = 1; k < coefficients.size(); ++k) coefficients[k - 1] -= at * coefficients[k];
    }
    coefficients[0] += value;
    while (coefficients.back() == 0.0) coefficients.pop_back();
    return {coefficients};
  }

  bool couple_tendons(const Element& element, const double* poly, Form& form) const {
    if (element.has("tendon2") && !is_linear(poly))
      element.fail("is not linear: one of the last three of polycoef is not 0",
                   "couple two joints by it, or linearise it");
    const auto add = [&](const char* attribute, double factor) {
      const std::string name = element.name(attribute);
      const Tendon& tendon = scene_.tendon(name, element);
      if (tendon.is_spatial)
        element.fail(fmt::format("holds tendon '{}', which is spatial: that is not linear", shortened(name)),
                     "use fixed tendons, or set active=\"false\"");
      for (const auto& [joint, coefficient] : tendon.length.terms) {
        form.add(joint, factor * coefficient);
        form.constant -= factor * coefficient * scene_.joint(joint).ref;
      }
      return tendon.is_whole;
    };
    form.constant = -poly[0];
    bool is_whole = add("tendon1", 1.0);
    if (element.has("tendon2")) is_whole = add("tendon2", -poly[1]) && is_whole;
    return is_whole;
  }

  Scene& scene_;
};

}  // namespace

void read_equalities(Scene& scene) {
  for (const Element::Xml* xml : scene.section("equality")) scene.report().attempt([&] { Reader(scene).read(*xml); });
}

}  // namespace lockstep::importer::mjcf
