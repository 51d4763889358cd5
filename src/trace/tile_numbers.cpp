// The numbers of a traced tile: their names, and their places in the kernel's own tile. SPDX-License-Identifier:
// Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <type_traits>

#include "kernels/tile/own_numbers.h"
#include "tracer.h"

namespace lockstep::trace {

using kernels::Lifetime;

namespace {

struct Part {  // a number in an array's element: suffix in C++ code, in a name
  std::string in_code, in_name;
  bool mask = false;
};

std::vector<Part> parts(const Traced*) { return {{"", ""}}; }
std::vector<Part> parts(const Traced::Mask*) { return {{"", "", true}}; }
std::vector<Part> parts(const kernels::Branch<Traced>*) {
  return {{".low", "_low", true}, {".high", "_high", true}, {".stuck", "_stuck", true}, {".impulse", "_impulse"}};
}
std::vector<Part> parts(const kernels::AuditState<Traced>*) {
  return {{".gained", "_gained"},
          {".most", "_most"},
          {".kinetic", "_kinetic"},
          {".potential", "_potential"},
          {".known", "_known", true}};
}
std::vector<Part> parts(const kernels::StageRow<Traced>*) {
  std::vector<Part> all;
  for (const char* end : {"low", "high"})
    for (const char* number : {"gap", "rate", "restitution", "time", "arrival", "gained"})
      all.push_back({fmt::format(".{}.{}", end, number), fmt::format("_{}_{}", end, number)});
  for (const char* number : {"most", "prescribed", "force", "direction", "reversal", "inertia_share"})
    all.push_back({fmt::format(".{}", number), fmt::format("_{}", number)});
  return all;
}
std::vector<Part> parts(const simd::Vec3<Traced>*) { return {{".x", "_x"}, {".y", "_y"}, {".z", "_z"}}; }
std::vector<Part> parts(const simd::Mat3<Traced>*) {
  std::vector<Part> all;
  for (int k = 0; k < 9; ++k) {
    const char row = "xyz"[k / 3], column = "xyz"[k % 3];
    all.push_back({fmt::format(".{}.{}", row, column), fmt::format("_{}{}", row, column)});
  }
  return all;
}
void add_symmetric(const char* member, const char* name, std::vector<Part>& all) {
  const char* const pairs[] = {"xx", "yy", "zz", "yz", "xz", "xy"};
  for (int k = 0; k < 6; ++k) all.push_back({fmt::format(".{}[{}]", member, k), fmt::format("{}_{}", name, pairs[k])});
}
std::vector<Part> parts(const simd::PseudoInertia<Traced>*) {
  std::vector<Part> all{{".mass", "_mass"}, {".moment.x", "_hx"}, {".moment.y", "_hy"}, {".moment.z", "_hz"}};
  add_symmetric("second", "", all);
  return all;
}
std::vector<Part> parts(const simd::ArticulatedInertia<Traced>*) {
  std::vector<Part> all;
  add_symmetric("angular", "_angular", all);
  for (const Part& part : parts(static_cast<const simd::Mat3<Traced>*>(nullptr)))
    all.push_back({".across" + part.in_code, "_across" + part.in_name});
  add_symmetric("linear", "_linear", all);
  return all;
}
std::vector<Part> parts(const void*) { return {}; }  // elements that only called stages read

// What only the tables read and write: contacts, and copies of what is remembered of them.
bool for_tables_alone(const std::string& array) {
  return array.starts_with("contacts.") || array == "guard.remembered" || array == "guard.found";
}

}  // namespace

/// Stands in for kernels::Carver. Here no two arrays share memory.
struct Take {
  Tracer* tracer;
  void behind(const Take&) {}  // nothing to do: copies use the same block
  template <class E>
  void operator()(const char* name, E*& array, int count, Lifetime lasts = Lifetime::step) {
    const std::size_t first = tracer->used_;
    array = count > 0 ? reinterpret_cast<E*>(tracer->block_.data() + first) : nullptr;
    tracer->used_ += sizeof(E) * static_cast<std::size_t>(count);
    std::string stem = name;
    const std::vector<Part> all = for_tables_alone(stem) ? std::vector<Part>() : parts(array);
    std::replace(stem.begin(), stem.end(), '.', '_');
    Id* number = reinterpret_cast<Id*>(array);
    int in_array = 0;
    for (int i = 0; i < count; ++i)
      for (const Part& part : all)
        tracer->add_number(number++,
                           {fmt::format("x.{}[{}]{}", name, i, part.in_code), tracer->arrays_, in_array++,
                            lasts == Lifetime::call || lasts == Lifetime::turn, lasts == Lifetime::turn},
                           fmt::format("{}_{}{}", stem, i, part.in_name), lasts, array, part.mask);
    ++tracer->arrays_;
  }
};

namespace {

struct Measure {
  std::size_t* bytes;
  void behind(const Measure&) {}
  template <class E>
  void operator()(const char*, E*& array, int count, Lifetime = Lifetime::step) {
    array = nullptr;
    *bytes += sizeof(E) * static_cast<std::size_t>(count);
  }
};

}  // namespace

Tracer::Tracer(const Tables<double>& tables, TracedTile& tile, bool routine) : tile_(tile) {
  tracer = this;
  std::size_t bytes = 0;
  Measure measure{&bytes};
  kernels::arrays(tables, tile, measure);
  block_.assign(bytes + 1, std::byte(0xfe));  // below -1, so that trace_operation() refuses what has no number
  number_at_.assign(bytes / sizeof(Id) + 1, -1);
  Take take{this};
  kernels::arrays(tables, tile, take);
  int place = 0;
  kernels::each_own(tile, [&](const char* name, auto& number, Lifetime lasts) {
    constexpr bool mask = std::is_same_v<std::decay_t<decltype(number)>, Traced::Mask>;
    const Place own{fmt::format("x.{}", name), Access::own, place++};
    if (static_cast<const void*>(&number) == &tile.too_fast && !tables.guarded && !tables.audited) return;
    add_number(&number.id, own, name, lasts, nullptr, mask);
    // What a step does not begin with.
    if (lasts != Lifetime::stage || routine || static_cast<const void*>(&number) == &tile.bounds.candidate) return;
    if constexpr (mask)
      number = Traced::none();
    else
      number = Traced(0.0);
  });
}

void Tracer::add_number(Id* now, const Place& place, const std::string& name, Lifetime lasts, const void* array,
                        bool mask) {
  numbers_.push_back({now, -1, place, name, lasts, array, mask});
  read(numbers_.back());
  const auto offset = reinterpret_cast<std::byte*>(now) - block_.data();
  if (array) number_at_[static_cast<std::size_t>(offset) / sizeof(Id)] = static_cast<int>(numbers_.size()) - 1;
}

void Tracer::read(TileNumber& number) {
  number.stored = *number.now = graph.input(number.place, number.mask);
  graph.name(number.stored, number.name);
}

}  // namespace lockstep::trace
