// Drives that are late: their memory, their lags, and what a step reads. SPDX-License-Identifier: Apache-2.0
#include "impl.h"

namespace lockstep {
namespace {

// (M154), for a step that is x time constants long.
struct Lag {
  double mean, kept;
};

Lag lag_of(double x) {
  if (!(x < 700.0)) return {1.0 / x, 0.0};
  const double mean = x < 1e-3 ? 1.0 - x / 2.0 + x * x / 6.0 : (1.0 - exponential(-x)) / x;
  return {mean, 1.0 - x * mean};
}

}  // namespace

template <class S>
void Batch<S>::Impl::settle_drives(int e) {
  const ActuatorTables<S>& late = tables.actuators;
  if (!late.is_late()) return;
  const AlignedBlock<S>* const shown[drive_inputs] = {&rows.position_target, &rows.velocity_target, &rows.effort};
  const auto number = [&](int input, int joint) { return shown[input]->data()[tables.dof[joint] * stride + e]; };
  S *const waiting = rows.waiting_input.data(), *const lagged = rows.lagged_input.data();
  std::ptrdiff_t to = e;
  for (int i = 0; i < late.delayed.count; ++i)
    for (int input = 0; input < drive_inputs; ++input)
      for (int step = 0; step < late.delayed[i].most; ++step, to += stride)
        waiting[to] = number(input, late.delayed[i].joint);
  to = e;
  for (int i = 0; i < late.lagged.count; ++i)
    for (int input = 0; input < drive_inputs; ++input, to += stride) lagged[to] = number(input, late.lagged[i]);
}

template <class S>
StatePointers<S> Batch<S>::Impl::pointers_of_step() const {
  StatePointers<S> l = state_pointers();
  if (tables.actuators.is_late()) {
    const S** const read[drive_inputs] = {&l.position_target, &l.velocity_target, &l.effort};
    for (int input = 0; input < drive_inputs; ++input) {
      l.shown_input[input] = *read[input];
      *read[input] = l.applied_input + input * tables.joints * stride;
    }
  }
  if (tables.actuators.motors.count > 0) {
    const S*& limit = l.fields[static_cast<unsigned>(Parameter::effort_limit)];
    l.shown_limit = limit;
    limit = l.applied_limit;
  }
  return l;
}

// Of environments [first, last). A time constant that is no number has a fault already.
template <class S>
void Batch<S>::Impl::find_lags(std::ptrdiff_t first, std::ptrdiff_t last) {
  const S* const own = rows.field(Parameter::drive_lag).data();
  const Fields& model = fields_of(program_of(plan));
  for (int i = 0; i < tables.actuators.lagged.count; ++i) {
    const int dof = tables.dof[tables.actuators.lagged[i]];
    const S models = static_cast<S>(model.value(Parameter::drive_lag, dof));
    S* const known = rows.lag.data() + lag_rows * i * stride;
    for (std::ptrdiff_t e = first; e < last; ++e) {
      const S constant = own ? own[dof * stride + e] : models;
      S* const lag = known + e;
      if (lag[0] == constant) continue;
      const Lag numbers =
          constant > S(0) ? lag_of(static_cast<double>(tables.step) / static_cast<double>(constant)) : Lag{0.0, 0.0};
      lag[0] = constant, lag[stride] = static_cast<S>(numbers.mean), lag[2 * stride] = static_cast<S>(numbers.kept);
    }
  }
}

template void Batch<float>::Impl::settle_drives(int);
template StatePointers<float> Batch<float>::Impl::pointers_of_step() const;
template void Batch<float>::Impl::find_lags(std::ptrdiff_t, std::ptrdiff_t);

template void Batch<double>::Impl::settle_drives(int);
template StatePointers<double> Batch<double>::Impl::pointers_of_step() const;
template void Batch<double>::Impl::find_lags(std::ptrdiff_t, std::ptrdiff_t);

}  // namespace lockstep
