// Batch::randomize(): fields of random mechanisms, judged before they are written. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "impl.h"

namespace lockstep {
namespace {

void require(bool holds, const char* element, const std::string& rule, const std::string& remedy) {
  if (!holds) throw UsageError(std::string(element) + " of the randomization", rule, remedy);
}

void check_randomization(const Randomization& how, Parameter parameter, int rows) {
  check_stream(how.stream);
  require(how.change >= Change::scale && how.change <= Change::absolute, "change", "is none of the enumerators",
          "give scale, add or absolute");
  require(how.distribution >= Distribution::uniform && how.distribution <= Distribution::normal, "distribution",
          "is none of the enumerators", "give uniform, log_uniform or normal");
  require(std::isfinite(how.low) && std::isfinite(how.high), "range", fmt::format("is {} to {}", how.low, how.high),
          "give finite numbers");
  if (how.distribution == Distribution::normal)
    require(how.high >= 0.0, "standard deviation", fmt::format("is {}", how.high), "give 0 or more as high");
  else
    require(how.low <= how.high && std::isfinite(how.high - how.low), "range",
            fmt::format("is {} to {}", how.low, how.high), "give low <= high, and a finite difference");
  if (how.distribution == Distribution::log_uniform)
    require(how.low > 0.0, "low", fmt::format("is {}, which has no logarithm", how.low), "give a number above 0");
  for (const int row : how.rows)
    require(row >= 0 && row < rows, "row", fmt::format("is {}, outside field {}", row, to_string(parameter)),
            fmt::format("give 0 to {}", rows - 1));
}

double result_of(const Randomization& how, double compiled, double number) {
  switch (how.change) {
    case Change::scale: return compiled * number;
    case Change::add: return compiled + number;
    case Change::absolute: break;
  }
  return number;
}

// One field of a batch.
template <class S, class Batch>
class Randomizer {
 public:
  Randomizer(Batch& batch, Parameter parameter, const Randomization& how)
      : batch_(batch), parameter_(parameter), how_(how), block_(batch.rows.field(parameter)) {
    const std::vector<double>& compiled = fields_of(program_of(batch.plan)).values[static_cast<int>(parameter)];
    const auto add = [&](int row) { rows_.push_back({row, compiled[static_cast<std::size_t>(row)], nullptr}); };
    for (const int row : how.rows) add(row);
    for (std::size_t row = 0; how.rows.empty() && row < compiled.size(); ++row)
      if (std::isfinite(compiled[row])) add(static_cast<int>(row));
    if (how.distribution == Distribution::log_uniform) log_ratio_ = logarithm(how.high) - logarithm(how.low);
    for (Row& row : rows_)
      for (const ValueRule<S>& rule : batch.rules.rows)
        if (rule.field == parameter && rule.row == row.index) row.rule = &rule;
  }

  // What low and high allow.
  void check_bounds() const {
    if (how_.distribution == Distribution::normal) return;
    for (const Row& row : rows_) {
      const double least = result_of(how_, row.compiled, how_.low), most = result_of(how_, row.compiled, how_.high);
      for (const double end : {least, most}) check(row, written(end), -1);
      // A magnitude is smallest between its ends.
      if (row.rule && row.rule->field == Parameter::gear_ratio && (least < 0.0) != (most < 0.0)) check(row, S(0), -1);
    }
  }

  bool must_look() const {
    const bool moves_inertia =
        parameter_ == Parameter::mass || parameter_ == Parameter::center_of_mass || parameter_ == Parameter::inertia;
    return how_.distribution == Distribution::normal ||
           (parameter_ == Parameter::position_limits && !batch_.rules.pairs.empty()) ||
           (parameter_ == Parameter::mass && !batch_.rules.bodies.empty()) ||
           (moves_inertia && !batch_.rules.inertias.empty());
  }

  // Judges what would be written, and puts back what stands there.
  void look(int e) {
    keep(before_, e);
    write(e);
    keep(after_, e);
    const std::string broken = broken_rule(e);
    for (std::size_t i = 0; i < rows_.size(); ++i) number(rows_[i], e) = before_[i];
    for (std::size_t i = 0; i < rows_.size(); ++i) check(rows_[i], after_[i], e);
    if (!broken.empty())
      throw UsageError(broken, fmt::format("no Model could have them, in environment {}", e), remedy);
  }

  void write(int e) {
    Draws draws = batch_.draws(e, how_.stream, purpose_of(parameter_));
    for (const Row& row : rows_)
      number(row, e) = written(result_of(how_, row.compiled, number_of(draws, how_.shared ? 0 : row.index)));
  }

 private:
  struct Row {
    int index;
    double compiled;
    const ValueRule<S>* rule;  // null: any number
  };

  double number_of(Draws& draws, int row) const {
    switch (how_.distribution) {
      case Distribution::uniform: return how_.low + (how_.high - how_.low) * draws.uniform(row);
      case Distribution::normal: return how_.low + how_.high * draws.normal(row);
      case Distribution::log_uniform: break;
    }
    return how_.low * exponential(draws.uniform(row) * log_ratio_);
  }

  // Delays are whole steps.
  S written(double result) const {
    return static_cast<S>(parameter_ == Parameter::drive_delay ? std::round(result) : result);
  }

  static constexpr const char* remedy = "narrow the range of the randomization";

  S& number(const Row& row, int e) const { return block_.data()[row.index * batch_.stride + e]; }

  void keep(std::vector<S>& numbers, int e) const {
    numbers.clear();
    for (const Row& row : rows_) numbers.push_back(number(row, e));
  }

  // Of an environment; -1: of any.
  void check(const Row& row, S value, int e) const {
    if (row.rule ? row.rule->holds(value) : std::isfinite(value)) return;
    const std::string& name = batch_.plan.parameter_row_names(parameter_)[static_cast<std::size_t>(row.index)];
    throw UsageError(
        row.rule ? row.rule->element : fmt::format("field {} of '{}'", to_string(parameter_), name),
        fmt::format("{} {}, must be {}", e < 0 ? "may become" : fmt::format("becomes, in environment {},", e), value,
                    row.rule ? row.rule->range : "finite"),
        remedy);
  }

  // The element of a rule about several rows that an environment breaks; empty if it breaks none.
  std::string broken_rule(int e) const {
    if (parameter_ == Parameter::position_limits)
      for (const LimitPair& pair : batch_.rules.pairs)
        if (const S* const lower = block_.data() + pair.row * batch_.stride + e; !(lower[0] <= lower[batch_.stride]))
          return "limits of " + pair.element + ", not in ascending order";
    if (parameter_ == Parameter::mass)
      for (const BodyLinks& body : batch_.rules.bodies)
        if (!(batch_.mass_of(body, e) > S(0))) return "masses of link " + body.element + ", which sum up to 0";
    for (const InertiaRule<S>& rule : batch_.rules.inertias)
      if (!batch_.is_possible(rule, e)) return "moments of inertia of link " + rule.element;
    return "";
  }

  Batch& batch_;
  Parameter parameter_;
  const Randomization& how_;
  const AlignedBlock<S>& block_;
  double log_ratio_ = 0.0;  // of high to low
  std::vector<Row> rows_;
  std::vector<S> before_, after_;  // of one environment
};

}  // namespace

template <class S>
void Batch<S>::randomize(Parameter field, const Randomization& how, const EnvironmentSet& which) {
  check_randomization(how, field, static_cast<int>(parameter(field).rows()));
  Impl& batch = impl();
  const Alone alone(batch.in_use);
  which.check(batch.environments);
  Randomizer<S, Impl> randomizer(batch, field, how);
  randomizer.check_bounds();
  const simd::StepMode mode;
  if (randomizer.must_look()) which.for_each(batch.environments, [&](int e) { randomizer.look(e); });
  which.for_each(batch.environments, [&](int e) { randomizer.write(e); });
}

template void Batch<float>::randomize(Parameter, const Randomization&, const EnvironmentSet&);
template void Batch<double>::randomize(Parameter, const Randomization&, const EnvironmentSet&);

}  // namespace lockstep
