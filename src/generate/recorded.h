// A number that writes down what is done to it, for kernels to run on. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "graph.h"
#include "lockstep/error.h"

namespace lockstep::generate {

/// What the numbers of this thread are written down in, and where arrays are that name and explain them.
class Recorder;
inline thread_local Recorder* recorder = nullptr;

Id record_constant(double value);
Id record(Op op, Id a = -1, Id b = -1, Id c = -1);
/// As it stands: no other sum becomes part of it, and it becomes part of none.
Id record_as_it_stands(Op op, Id a, Id b, Id c = -1);
Id record_load(const double* p);
/// The number in memory at `place` is now `id`: a name for it, if `place` is in a known array.
void record_name(const void* place, Id id);

/// One line of code may stand for several lanes; which one is never known here.
struct Recorded {
  using Scalar = double;
  static constexpr int lanes = 1;
  struct Mask {
    Id id = -1;
    friend Mask operator|(Mask a, Mask b) { return {record(Op::either, a.id, b.id)}; }
    friend Mask operator&(Mask a, Mask b) { return {record(Op::both, a.id, b.id)}; }
    friend Mask operator~(Mask a) { return {record(Op::invert, a.id)}; }
  };

  Id id;

  Recorded() = default;
  Recorded(double value) : id(record_constant(value)) {}
  Recorded(const Recorded&) = default;
  Recorded& operator=(const Recorded& other) {
    id = other.id;
    record_name(this, id);
    return *this;
  }
  static Recorded of(Id id) {
    Recorded r;
    r.id = id;
    return r;
  }

  friend Recorded operator+(Recorded a, Recorded b) { return of(record(Op::add, a.id, b.id)); }
  friend Recorded operator-(Recorded a, Recorded b) { return of(record(Op::subtract, a.id, b.id)); }
  friend Recorded operator*(Recorded a, Recorded b) { return of(record(Op::multiply, a.id, b.id)); }
  friend Recorded operator/(Recorded a, Recorded b) { return of(record(Op::divide, a.id, b.id)); }
  friend Recorded operator-(Recorded a) { return of(record(Op::negate, a.id)); }
  Recorded& operator+=(Recorded b) { return *this = *this + b; }
  Recorded& operator-=(Recorded b) { return *this = *this - b; }
  Recorded& operator*=(Recorded b) { return *this = *this * b; }
  friend Recorded fma(Recorded a, Recorded b, Recorded c) { return of(record(Op::fma, a.id, b.id, c.id)); }
  friend Recorded fnma(Recorded a, Recorded b, Recorded c) { return of(record(Op::fnma, a.id, b.id, c.id)); }
  friend Recorded changed_by(Recorded number, Recorded change) { return of(record_as_it_stands(Op::add, number.id, change.id)); }
  friend Recorded add_product(Recorded a, Recorded b, Recorded sum) { return of(record_as_it_stands(Op::fma, a.id, b.id, sum.id)); }
  friend Recorded sqrt(Recorded a) { return of(record(Op::sqrt, a.id)); }
  friend void sincos(Recorded x, Recorded& sine, Recorded& cosine) {
    sine = of(record(Op::sine, x.id));
    cosine = of(record(Op::cosine, x.id));
  }
  friend Mask less(Recorded a, Recorded b) { return {record(Op::less, a.id, b.id)}; }
  friend Mask beyond(Recorded a, Recorded b) { return {record(Op::beyond, a.id, b.id)}; }
  friend Recorded farther(Recorded most, Recorded a) { return of(record(Op::farther, most.id, a.id)); }
  friend Recorded select(Mask m, Recorded yes, Recorded no) { return of(record(Op::select, m.id, yes.id, no.id)); }
  static Mask none() { return {record(Op::none)}; }
  static Recorded rounding() { return of(record(Op::rounding)); }
  static Recorded load(const double* p) { return of(record_load(p)); }

  // Lanes that are treated one by one have no straight-line code.
  double lane(int) const { refuse(); }
  void set_lane(int, double) { refuse(); }
  [[noreturn]] static void refuse() {
    throw SettingsError("method tgs with a softness per environment", "is worked out lane by lane, which generated code cannot",
                        "leave this plan to the tables, or use another method");
  }
};

}  // namespace lockstep::generate
