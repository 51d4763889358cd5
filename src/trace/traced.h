// A number that records what kernels do to it. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ir.h"
#include "lockstep/error.h"

namespace lockstep::trace {

/// Where the traced numbers of this thread are recorded.
class Tracer;
inline thread_local Tracer* tracer = nullptr;
/// If not null, operations are only counted, in this.
struct Cost;
inline thread_local Cost* counting = nullptr;

Id trace_constant(double value);
Id trace_by_precision(double single, double twice);
Id trace_operation(Op op, Id a = -1, Id b = -1, Id c = -1);
/// A sum that is not reassociated: no other sum becomes part of it, and it becomes part of none.
Id trace_as_it_stands(Op op, Id a, Id b, Id c = -1);
Id trace_load(const double* p);
/// The number at `place` is now `id`. If `place` is in an array of the tile, this gives the node a name.
void trace_name(const void* place, Id id);

/// A traced number. It stands for all lanes, whose values are not known.
struct Traced {
  using Scalar = double;
  static constexpr int lanes = 1;
  struct Mask {
    Id id = -1;
    friend Mask operator|(Mask a, Mask b) { return {trace_operation(Op::either, a.id, b.id)}; }
    friend Mask operator&(Mask a, Mask b) { return {trace_operation(Op::both, a.id, b.id)}; }
    friend Mask operator~(Mask a) { return {trace_operation(Op::invert, a.id)}; }
    /// Traced code always does the work that this test could save.
    friend bool any(Mask) { return true; }
  };

  Id id;

  Traced() = default;
  Traced(double value) : id(trace_constant(value)) {}
  Traced(const Traced&) = default;
  Traced& operator=(const Traced& other) {
    id = other.id;
    trace_name(this, id);
    return *this;
  }
  static Traced of(Id id) {
    Traced r;
    r.id = id;
    return r;
  }

  friend Traced operator+(Traced a, Traced b) { return of(trace_operation(Op::add, a.id, b.id)); }
  friend Traced operator-(Traced a, Traced b) { return of(trace_operation(Op::subtract, a.id, b.id)); }
  friend Traced operator*(Traced a, Traced b) { return of(trace_operation(Op::multiply, a.id, b.id)); }
  friend Traced operator/(Traced a, Traced b) { return of(trace_operation(Op::divide, a.id, b.id)); }
  friend Traced operator-(Traced a) { return of(trace_operation(Op::negate, a.id)); }
  Traced& operator+=(Traced b) { return *this = *this + b; }
  Traced& operator-=(Traced b) { return *this = *this - b; }
  Traced& operator*=(Traced b) { return *this = *this * b; }
  friend Traced fma(Traced a, Traced b, Traced c) { return of(trace_operation(Op::fma, a.id, b.id, c.id)); }
  friend Traced fnma(Traced a, Traced b, Traced c) { return of(trace_operation(Op::fnma, a.id, b.id, c.id)); }
  friend Traced changed_by(Traced number, Traced change) {
    return of(trace_as_it_stands(Op::add, number.id, change.id));
  }
  friend Traced add_product(Traced a, Traced b, Traced sum) {
    return of(trace_as_it_stands(Op::fma, a.id, b.id, sum.id));
  }
  friend Traced sqrt(Traced a) { return of(trace_operation(Op::sqrt, a.id)); }
  friend void sincos(Traced x, Traced& sine, Traced& cosine) {
    sine = of(trace_operation(Op::sine, x.id));
    cosine = of(trace_operation(Op::cosine, x.id));
  }
  friend Mask less(Traced a, Traced b) { return {trace_operation(Op::less, a.id, b.id)}; }
  friend Mask beyond(Traced a, Traced b) { return {trace_operation(Op::beyond, a.id, b.id)}; }
  friend Traced farther(Traced most, Traced a) { return of(trace_operation(Op::farther, most.id, a.id)); }
  friend Traced select(Mask m, Traced yes, Traced no) { return of(trace_operation(Op::select, m.id, yes.id, no.id)); }
  static Mask none() { return {trace_operation(Op::none)}; }
  static Traced rounding() { return by_precision(1.2e-7, 2.3e-16); }
  static Traced by_precision(double single, double twice) { return of(trace_by_precision(single, twice)); }
  static Traced load(const double* p) { return of(trace_load(p)); }

  // Code that treats lanes one by one has no straight-line form.
  double lane(int) const {
    refuse();
    return 1.0;
  }
  void set_lane(int, double) { refuse(); }
  static void refuse() {
    if (counting) return;
    throw SettingsError("method tgs with a softness per environment",
                        "is computed lane by lane, which compiled and generated code cannot do",
                        "use Engine::tables, or another method");
  }
};

}  // namespace lockstep::trace
