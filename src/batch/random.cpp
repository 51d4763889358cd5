// Batch: ids, seeds, draws. SPDX-License-Identifier: Apache-2.0
#include "impl.h"

namespace lockstep {

void check_stream(unsigned stream) {
  if (stream >= stream_count)
    throw UsageError("stream " + std::to_string(stream), "is none of the " + std::to_string(stream_count) + " streams",
                     "give 0 to " + std::to_string(stream_count - 1));
}

namespace {

// For each row of each environment.
template <class S, class Number>
void fill(const StridedRows<S>& out, int rows, unsigned stream, const EnvironmentSet& which, int environments,
          const Number& number) {
  check_stream(stream);
  if (rows < 0) throw UsageError("rows", "are " + std::to_string(rows), "give 0 or more");
  if (!out.data && rows > 0) throw UsageError("memory of the draws", "is null", "give memory for the rows");
  const simd::StepMode mode;
  which.for_each(environments, [&](int e) {
    S* const column = out.data + e * out.environment_stride;
    number(e, [&](const auto& drawn) {
      for (int row = 0; row < rows; ++row) column[row * out.row_stride] = static_cast<S>(drawn(row));
    });
  });
}

}  // namespace

template <class S>
std::span<std::uint32_t> Batch<S>::ids() {
  return {impl().rows.id.data(), static_cast<std::size_t>(impl().environments)};
}
template <class S>
std::span<std::uint64_t> Batch<S>::seeds() {
  return {impl().rows.seed.data(), static_cast<std::size_t>(impl().environments)};
}
template <class S>
std::span<const std::uint32_t> Batch<S>::ids() const {
  return {impl().rows.id.data(), static_cast<std::size_t>(impl().environments)};
}
template <class S>
std::span<const std::uint64_t> Batch<S>::seeds() const {
  return {impl().rows.seed.data(), static_cast<std::size_t>(impl().environments)};
}

template <class S>
void Batch<S>::draw(const StridedRows<S>& out, int rows, unsigned stream, const EnvironmentSet& which) const {
  const Impl& batch = impl();
  const Alone alone(impl().in_use);
  fill(out, rows, stream, which, batch.environments, [&](int e, const auto& put) {
    Draws draws = batch.draws(e, stream, Purpose::uniform);
    put([&](int row) { return draws.uniform(row); });
  });
}

template <class S>
void Batch<S>::draw_normal(const StridedRows<S>& out, int rows, unsigned stream, const EnvironmentSet& which) const {
  const Impl& batch = impl();
  const Alone alone(impl().in_use);
  fill(out, rows, stream, which, batch.environments, [&](int e, const auto& put) {
    Draws draws = batch.draws(e, stream, Purpose::normal);
    put([&](int row) { return draws.normal(row); });
  });
}

template std::span<std::uint32_t> Batch<float>::ids();
template std::span<std::uint32_t> Batch<double>::ids();
template std::span<std::uint64_t> Batch<float>::seeds();
template std::span<std::uint64_t> Batch<double>::seeds();
template std::span<const std::uint32_t> Batch<float>::ids() const;
template std::span<const std::uint32_t> Batch<double>::ids() const;
template std::span<const std::uint64_t> Batch<float>::seeds() const;
template std::span<const std::uint64_t> Batch<double>::seeds() const;
template void Batch<float>::draw(const StridedRows<float>&, int, unsigned, const EnvironmentSet&) const;
template void Batch<double>::draw(const StridedRows<double>&, int, unsigned, const EnvironmentSet&) const;
template void Batch<float>::draw_normal(const StridedRows<float>&, int, unsigned, const EnvironmentSet&) const;
template void Batch<double>::draw_normal(const StridedRows<double>&, int, unsigned, const EnvironmentSet&) const;

}  // namespace lockstep
