// <tendon> and <equality>. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "coupling_inertia.h"
#include "model/softness_numbers.h"
#include "model/tendons.h"
#include "sections.h"

namespace lockstep::exporter::mjcf {
namespace {

// Of the constraints' springs. MuJoCo raises time constants below 2 steps, and takes impedances up to 0.9999.
constexpr double steps = 4.0;
constexpr const char* impedance = "0.9999 0.9999 0.001 0.5 2";
constexpr std::size_t most_coefficients = 5;  // of MuJoCo's polynomials

class Couplings {
 public:
  explicit Couplings(const Writing& writing)
      : writing_(writing), model_(writing.model), report_(writing.report), xml_(writing.xml) {}

  void write() {
    const std::vector<std::string> names = coupling_names(model_);
    for (std::size_t c = 0; c < names.size(); ++c) judge(c, names[c]);
    const auto has_tendon = [&](std::size_t c) {
      return springs_[c] || model_.couplings[c].terms.size() > 1 || tendon_of(model_.couplings[c], model_);
    };
    section("tendon", has_tendon, [&](std::size_t c) { write_tendon(c, names[c]); });
    section(
        "equality", [&](std::size_t c) { return is_held_[c] && !tendon_of(model_.couplings[c], model_); },
        [&](std::size_t c) { write_equality(c, names[c]); });
  }

 private:
  template <class Belongs, class Write>
  void section(const char* tag, Belongs belongs, Write write) {
    bool is_open = false;
    for (std::size_t c = 0; c < model_.couplings.size(); ++c) {
      if (!belongs(c) || is_without_effect_[c]) continue;
      if (!is_open) xml_.open(tag);
      is_open = true;
      write(c);
    }
    if (is_open) xml_.close();
  }

  void judge(std::size_t c, const std::string& name) {
    const Coupling& coupling = model_.couplings[c];
    const Softness& softness = coupling.softness;
    springs_.push_back(coupling.function ? std::nullopt : spring_of(c, name));
    is_without_effect_.push_back(is_absent(softness));
    is_held_.push_back(coupling.function ? polynomial_of(coupling) != nullptr : is_hard(softness));
    if (tendon_of(model_.couplings[c], model_)) {
      report_.remark("tendons, as fixed tendons", name);
      if (coupling.offset != 0.0) report_.remark("tendons whose length has their offset", name);
      return;
    }
    if (is_absent(softness)) report_.remark("couplings without stiffness and damping, left out", name);
    if (coupling.force_limit < infinity) report_.warn("force limits of couplings, left out", name);
    if (coupling.function && !is_held_[c])
      return report_.warn("followers by a function that is no polynomial of at most degree 4, left out", name);
    if (!is_hard(softness)) return;
    report_.remark(fmt::format("hard couplings, which MuJoCo holds by springs of {:g} s: larger steps do not hold them",
                               time_constant(writing_.timestep)),
                   name);
    if (erp_of(softness) != Hard().erp) report_.remark("shares of an error that a step corrects (erp), left out", name);
  }

  // The function, if MuJoCo can have it.
  static const Polynomial* polynomial_of(const Coupling& coupling) {
    const Polynomial* found = std::get_if<Polynomial>(&*coupling.function);
    return found && found->coefficients.size() <= most_coefficients ? found : nullptr;
  }

  // Of a soft coupling, along its first joint.
  std::optional<Spring> spring_of(std::size_t c, const std::string& name) {
    const Softness& softness = model_.couplings[c].softness;
    if (const auto* spring = std::get_if<Spring>(&softness)) return *spring;
    if (const auto* mixed = std::get_if<ErpCfm>(&softness); mixed && mixed->cfm > 0.0) {
      report_.warn("couplings soft by erp and cfm, as they are at the file's step", name);
      const double h = writing_.timestep;  // (M29)
      return Spring{mixed->erp / (h * h * mixed->cfm), (1.0 - mixed->erp) / (h * mixed->cfm)};
    }
    if (const auto* frequency = std::get_if<Frequency>(&softness)) {
      report_.warn("couplings soft by frequency, as they are at the inertia of the start", name);
      if (inertias_.empty()) inertias_ = coupling_inertias(model_);
      const double mu = frequency->rad_per_s;
      return Spring{mu * mu * inertias_[c], 2.0 * mu * frequency->damping_ratio * inertias_[c]};
    }
    return std::nullopt;
  }

  // The joints' sum, which is -offset where the coupling holds. A tendon's length is its position and its offset.
  void write_tendon(std::size_t c, const std::string& name) {
    const Coupling& coupling = model_.couplings[c];
    xml_.open("fixed").set("name", name);
    if (springs_[c]) {
      // A length of -1 would be that of the joints' own springs.
      const double length = coupling.offset == 1.0 ? std::nextafter(-1.0, 0.0) : -coupling.offset;
      xml_.set_unless(0.0, "stiffness", springs_[c]->kp).set_unless(0.0, "damping", springs_[c]->kd);
      xml_.set("springlength", numbers(length));
    }
    const Joint* tendon = tendon_of(model_.couplings[c], model_);
    if (tendon) write_resistance(*tendon, coupling.offset, xml_, report_);
    const auto add = [&](const std::string& joint, double ratio) {
      xml_.open("joint").set("joint", joint).set("coef", numbers(ratio)).close();
    };
    if (!tendon) add(coupling.joint, 1.0);
    for (const CouplingTerm& term : coupling.terms) add(term.joint, tendon ? -term.ratio : term.ratio);
    xml_.close();
  }

  void write_equality(std::size_t c, const std::string& name) {
    const Coupling& coupling = model_.couplings[c];
    const bool is_pair = coupling.terms.size() == 1;
    xml_.open(is_pair ? "joint" : "tendon").set("name", name);
    if (is_pair)
      xml_.set("joint1", coupling.joint).set("joint2", coupling.terms.front().joint);
    else
      xml_.set("tendon1", name);
    std::vector<double> coefficients = {-coupling.offset, is_pair ? -coupling.terms.front().ratio : 1.0};
    if (coupling.function) coefficients = polynomial_of(coupling)->coefficients;
    coefficients.resize(most_coefficients);
    xml_.set("polycoef", numbers(coefficients));
    write_hardness(writing_.timestep, xml_);
    xml_.close();
  }

  const Writing& writing_;
  const Model& model_;
  Report& report_;
  Xml& xml_;
  std::vector<std::optional<Spring>> springs_;     // by coupling
  std::vector<bool> is_without_effect_, is_held_;  // by an equality
  std::vector<double> inertias_;
};

}  // namespace

double time_constant(double timestep) { return steps * timestep; }

void write_hardness(double timestep, Xml& xml) {
  xml.set("solref", numbers({time_constant(timestep), 1.0})).set("solimp", impedance);
}

void write_couplings(const Writing& writing) { Couplings(writing).write(); }

}  // namespace lockstep::exporter::mjcf
