// SPDX-License-Identifier: Apache-2.0
#include "judgement.h"

#include <algorithm>
#include <cmath>
#include <complex>

namespace lockstep::stability {
namespace {

using Array = Eigen::ArrayXXd;

constexpr double largest_held = 1e-5, largest_loose = 1e-2;  // |C|, rad
constexpr double allowed_gain = 0.1;       // of energy, as a share of the span: semi-implicit Euler's energy oscillates
constexpr double damped_from = 0.1;        // relative change of the mode's root, and so of frequency and damping ratio
constexpr double allowed_distance = 0.05;  // from the closed form, as a share of the first error

StepSettings settings(const Map& map, Method method, const Setup& setup) {
  StepSettings result{.integrator = Integrator::euler};
  result.dt = setup.dt;
  result.method = method;
  result.iterations = std::max(1, setup.sweeps);
  result.per_environment = map.per_environment;
  return result;
}

// Writes what differs between the models into the environments.
void load(Batch<float>& batch, const std::vector<Setup>& setups) {
  const auto fill = [&](Parameter field, auto&& values_of) {
    if (!batch.plan().settings().per_environment.contains(field)) return;
    auto view = batch.parameter(field);
    for (std::size_t e = 0; e < setups.size(); ++e) {
      int row = 0;
      values_of(setups[e].model, [&](double value) { view(row++, e) = static_cast<float>(value); });
    }
  };
  fill(Parameter::gear_ratio, [](const Model& model, auto&& put) {
    for (const Coupling& coupling : model.couplings)
      for (const CouplingTerm& term : coupling.terms) put(term.ratio);
  });
  fill(Parameter::mass, [](const Model& model, auto&& put) {
    for (const Link& link : model.links) put(link.inertia.mass);
  });
  fill(Parameter::drive_gains, [](const Model& model, auto&& put) {
    for (const Joint& joint : model.joints) put(joint.drive.kp), put(joint.drive.kd);
  });
  fill(Parameter::damping, [](const Model& model, auto&& put) {
    for (const Joint& joint : model.joints) put(joint.damping);
  });
  for (std::size_t e = 0; e < setups.size(); ++e)
    for (std::size_t j = 0; j < setups[e].model.joints.size(); ++j)  // no joint of these models is fixed
      batch.positions()(j, e) = static_cast<float>(setups[e].model.joints[j].position);
}

// Energy of the servos' springs, J.
double spring_energy(const Model& model, const Eigen::ArrayXd& q) {
  double sum = 0.0;
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const Drive& drive = model.joints[j].drive;
    sum += 0.5 * drive.kp * (q[j] - drive.position_target) * (q[j] - drive.position_target);
  }
  return sum;
}

// The potential energy between the lowest and the highest places that the links can reach, J. For each link they are
// apart by twice the length of the chain that carries it.
double span_of_heights(const Model& model) {
  double sum = 0.0;
  std::vector<double> reach(model.links.size(), 0.0);
  for (const Joint& joint : model.joints) {
    const int child = model.link_index(joint.child);
    const Inertia& inertia = model.links[child].inertia;
    reach[child] = reach[model.link_index(joint.parent)] + joint.origin.translation().norm();
    sum += 2.0 * model.gravity.norm() * inertia.mass * (reach[child] + inertia.center.norm());
  }
  return sum;
}

// The energies of the environments, and their bounds.
class Budget {
 public:
  Budget(const Batch<float>& batch, const std::vector<Setup>& setups) : setups_(setups) {
    start_ = energies(batch);
    const Array errors = batch.coupling_errors().abs().cast<double>();
    for (std::size_t e = 0; e < setups.size(); ++e) {
      const Model& model = setups[e].model;
      const double heights = span_of_heights(model), error = errors.col(e).maxCoeff();
      span_.push_back(heights + spring_energy(model, batch.positions().col(e).cast<double>()));
      // The correction of an error moves each link by its reach at most. A start without errors has no correction.
      start_[e] += heights * std::min(1.0, error);
    }
    excess_.assign(setups.size(), 0.0);
  }

  void update(const Batch<float>& batch) {
    const std::vector<double> now = energies(batch);
    for (std::size_t e = 0; e < now.size(); ++e) excess_[e] = std::max(excess_[e], (now[e] - start_[e]) / span_[e]);
  }

  const std::vector<double>& excess() const { return excess_; }

 private:
  std::vector<double> energies(const Batch<float>& batch) const {
    const Array mechanical = batch.kinetic_energies().cast<double>() + batch.potential_energies().cast<double>();
    const Array q = batch.positions().cast<double>();
    std::vector<double> sum;
    for (std::size_t e = 0; e < setups_.size(); ++e)
      sum.push_back(mechanical(0, e) + spring_energy(setups_[e].model, q.col(e)));
    return sum;
  }

  const std::vector<Setup>& setups_;
  std::vector<double> start_, span_, excess_;
};

Class classify(const Verdict& verdict) {
  if (verdict.fault != Fault::none) return Class::fault;
  if (verdict.excess > allowed_gain) return Class::energy;
  return verdict.error <= largest_held ? Class::holds : verdict.error <= largest_loose ? Class::loose : Class::open;
}

std::vector<Verdict> energy_and_errors(Batch<float>& batch, const std::vector<Setup>& setups) {
  const double dt = setups[0].dt;
  const int stride = std::max(1, static_cast<int>(std::lround(0.05 / dt)));
  const int steps = static_cast<int>(std::lround(seconds / dt)), last_second = steps - static_cast<int>(1.0 / dt);
  std::vector<Verdict> verdicts(setups.size());
  Budget budget(batch, setups);
  for (int done = stride; done <= steps; done += stride) {
    batch.step(stride);
    budget.update(batch);
    if (done < last_second) continue;
    const Array errors = batch.coupling_errors().abs().cast<double>();
    for (std::size_t e = 0; e < setups.size(); ++e)
      verdicts[e].error = std::max(verdicts[e].error, errors.col(e).maxCoeff());
  }
  for (std::size_t e = 0; e < setups.size(); ++e) {
    verdicts[e].excess = budget.excess()[e];
    verdicts[e].fault = batch.faults()[e];
    verdicts[e].kind = classify(verdicts[e]);
  }
  return verdicts;
}

// The mode in which all couplings of the star move together. K's eigenvalue over its diagonal (M28) is (1 + n) / 2 for
// n equal followers, and the spring of each coupling is that many times stiffer in this mode.
struct Mode {
  double frequency, damping;  // rad/s, 1/s: of x'' + 2 damping x' + frequency^2 x = 0

  explicit Mode(const Model& model) {
    const double n = static_cast<double>(model.couplings.size()), stiffer = (1.0 + n) / 2.0;
    const Frequency& softness = std::get<Frequency>(model.couplings[0].softness);
    frequency = softness.rad_per_s * std::sqrt(stiffer);
    damping = softness.rad_per_s * softness.damping_ratio * stiffer;
  }

  // The relative change by implicit Euler with steps of h: the larger of the changes of the two roots (M32).
  double change(double h) const {
    const std::complex<double> width = std::sqrt(std::complex<double>(damping * damping - frequency * frequency));
    double worst = 0.0;
    for (const double sign : {1.0, -1.0}) {
      const std::complex<double> stated = -damping + sign * width, shown = -std::log(1.0 - h * stated) / h;
      worst = std::max(worst, std::abs(shown - stated) / std::abs(stated));
    }
    return worst;
  }
};

std::vector<Verdict> closed_form(Batch<float>& batch, const Setup& setup) {
  const bool tgs = batch.plan().method() == Method::tgs;
  const int substeps = tgs ? setup.sweeps : 1;
  const double h = setup.dt / substeps;
  const Mode mode(setup.model);
  const double w2 = h * h * mode.frequency * mode.frequency, d = 2.0 * h * mode.damping;
  const double first = batch.coupling_errors()(0, 0);
  double c = first, speed = 0.0;  // of implicit Euler; speed is times h
  Verdict verdict;
  const int steps = static_cast<int>(std::lround(seconds / setup.dt));
  for (int i = 0; i < steps; ++i) {
    batch.step();
    for (int k = 0; k < substeps; ++k) {
      speed = (speed - w2 * c) / (1.0 + d + w2);
      c += speed;
    }
    const Array errors = batch.coupling_errors().cast<double>();
    verdict.error = std::max(verdict.error, (errors - c).abs().maxCoeff() / std::abs(first));
    verdict.excess = std::max(verdict.excess, errors.square().maxCoeff() / (first * first) - 1.0);
  }
  verdict.fault = batch.faults()[0];
  verdict.kind = verdict.fault != Fault::none       ? Class::fault
                 : verdict.excess > allowed_gain    ? Class::energy
                 : verdict.error > allowed_distance ? Class::off
                 : mode.change(h) > damped_from     ? Class::damped
                                                    : Class::holds;
  return {verdict};
}

}  // namespace

const char* to_string(Class kind) {
  constexpr const char* names[] = {"holds", "loose", "open", "damped", "off", "energy", "fault"};
  return names[static_cast<int>(kind)];
}

std::vector<Verdict> judge(const Map& map, Method method, const std::vector<Setup>& setups) {
  const Plan plan = compile(setups[0].model, settings(map, method, setups[0]));
  Batch<float> batch(plan, static_cast<int>(setups.size()), {.threads = 1});
  load(batch, setups);
  return map.judge == Judge::closed_form ? closed_form(batch, setups[0]) : energy_and_errors(batch, setups);
}

}  // namespace lockstep::stability
