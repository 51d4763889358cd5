// The tables in single precision. SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "layout.h"

namespace lockstep {
namespace {

// Bytes of the numbers that numbers() names.
template <class Table>
constexpr std::size_t bytes_of_numbers() {
  std::size_t bytes = 0;
  Table table{};
  Table::numbers(table, table, [&](const auto& number, const auto&) { bytes += sizeof(number); });
  return bytes;
}

// Whether numbers() names everything that Structure does not have.
template <class Table, class Structure>
constexpr bool names_all = sizeof(Table) == (sizeof(Structure) + 7) / 8 * 8 + bytes_of_numbers<Table>();

static_assert(names_all<Body<double>, BodyStructure> && names_all<LinkPlace<double>, LinkStructure> &&
              names_all<TreePlace<double>, TreeStructure> && names_all<RowSoftness<double>, RowSoftnessStructure> &&
              names_all<Rows<double>, RowStructure> && names_all<Bounds<double>, BoundStructure> &&
              names_all<Fill<double>, FillStructure> && names_all<Reduction<double>, ReductionStructure> &&
              names_all<ColliderPlace<double>, ColliderStructure> &&
              names_all<TouchingPair<double>, TouchingStructure> &&
              names_all<ContactTables<double>, ContactStructure> && names_all<HeldLoop<double>, LoopStructure> &&
              names_all<LoopTables<double>, LoopTableStructure> &&
              names_all<FunctionTables<double>, FunctionStructure> && names_all<Segment<double>, SegmentStructure> &&
              names_all<SpatialTendonTables<double>, SpatialTendonStructure>);
static_assert(sizeof(Tables<double>) ==
              (sizeof(TableStructure) + 7) / 8 * 8 + 2 * sizeof(void*) + bytes_of_numbers<Tables<double>>());

// Converts everything to single precision. `all_fit`: no number was too large for it.
struct Narrowing {
  TableStorage& storage;
  bool all_fit = true;

  void operator()(double from, float& to) {
    to = static_cast<float>(from);
    all_fit = all_fit && std::isfinite(to);
  }
  template <int N>
  void operator()(const double (&from)[N], float (&to)[N]) {
    for (int i = 0; i < N; ++i) (*this)(from[i], to[i]);
  }
  template <class From, class To>
  void operator()(const Span<From>& from, Span<To>& to) {
    std::vector<To> numbers(static_cast<std::size_t>(from.count));
    for (int i = 0; i < from.count; ++i) (*this)(from[i], numbers[static_cast<std::size_t>(i)]);
    to = storage.keep(std::move(numbers));
  }
  // Structure is the same in both precisions.
  template <class Structure, class From, class To>
  void table(const From& from, To& to) {
    static_cast<Structure&>(to) = from;
    From::numbers(from, to, *this);
  }
  void operator()(const Body<double>& from, Body<float>& to) { table<BodyStructure>(from, to); }
  void operator()(const LinkPlace<double>& from, LinkPlace<float>& to) { table<LinkStructure>(from, to); }
  void operator()(const TreePlace<double>& from, TreePlace<float>& to) { table<TreeStructure>(from, to); }
  void operator()(const RowSoftness<double>& from, RowSoftness<float>& to) { table<RowSoftnessStructure>(from, to); }
  void operator()(const Rows<double>& from, Rows<float>& to) { table<RowStructure>(from, to); }
  void operator()(const Bounds<double>& from, Bounds<float>& to) { table<BoundStructure>(from, to); }
  void operator()(const Fill<double>& from, Fill<float>& to) { table<FillStructure>(from, to); }
  void operator()(const Reduction<double>& from, Reduction<float>& to) { table<ReductionStructure>(from, to); }
  void operator()(const ColliderPlace<double>& from, ColliderPlace<float>& to) { table<ColliderStructure>(from, to); }
  void operator()(const TouchingPair<double>& from, TouchingPair<float>& to) { table<TouchingStructure>(from, to); }
  void operator()(const HeldLoop<double>& from, HeldLoop<float>& to) { table<LoopStructure>(from, to); }
  void operator()(const LoopTables<double>& from, LoopTables<float>& to) { table<LoopTableStructure>(from, to); }
  void operator()(const FunctionTables<double>& from, FunctionTables<float>& to) { table<FunctionStructure>(from, to); }
  void operator()(const Segment<double>& from, Segment<float>& to) { table<SegmentStructure>(from, to); }
  void operator()(const SpatialTendonTables<double>& from, SpatialTendonTables<float>& to) {
    table<SpatialTendonStructure>(from, to);
  }
  void operator()(const ActuatorTables<double>& from, ActuatorTables<float>& to) { table<ActuatorStructure>(from, to); }
  void operator()(const ContactTables<double>& from, ContactTables<float>& to) { table<ContactStructure>(from, to); }
};

}  // namespace

void narrow(Program& program) {
  Narrowing narrowing{program.storage};
  narrowing.table<TableStructure>(program.f64, program.f32);
  // Numbers of the tables may fit although those of a softness do not. They would be those of another coupling.
  for (const Coupling& coupling : program.model.couplings) {
    const SoftnessNumbers softness = numbers_of(coupling.softness);
    narrowing.all_fit = narrowing.all_fit && std::isfinite(static_cast<float>(softness.first)) &&
                        std::isfinite(static_cast<float>(softness.second));
  }
  program.fits_single = narrowing.all_fit && program.f32.dt > 0.0f;
}

}  // namespace lockstep
