// Environments as bytes, and back. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>
#include <numeric>

#include "blob.h"
#include "impl.h"
#include "lockstep/version.h"
#include "plan/identity.h"

namespace lockstep {
namespace {

// The numbers of environment from_ids[k] become those of environment to_ids[k]. No pointer need be aligned.
template <std::size_t number_bytes>
void copy_row(const std::byte* from, std::span<const int> from_ids, std::byte* to, std::span<const int> to_ids) {
  for (std::size_t k = 0; k < to_ids.size(); ++k)
    std::memcpy(to + static_cast<std::size_t>(to_ids[k]) * number_bytes,
                from + static_cast<std::size_t>(from_ids[k]) * number_bytes, number_bytes);
}

void copy_row(std::size_t number_bytes, const std::byte* from, std::span<const int> from_ids, std::byte* to,
              std::span<const int> to_ids) {
  (number_bytes == 4 ? copy_row<4> : copy_row<8>)(from, from_ids, to, to_ids);
}

std::vector<int> first_ids(std::size_t count) {
  std::vector<int> ids(count);
  std::iota(ids.begin(), ids.end(), 0);
  return ids;
}

std::string hex(std::uint64_t hash) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

// The first line in which the settings differ.
std::string first_difference(const std::string& saved, const std::string& own) {
  const auto at = std::mismatch(saved.begin(), saved.end(), own.begin(), own.end());
  const std::size_t place = static_cast<std::size_t>(at.first - saved.begin());
  const auto line = [&](const std::string& text) {
    const std::size_t begin = place == 0 ? 0 : text.rfind('\n', place - 1) + 1;
    return text.substr(begin, text.find('\n', begin) - begin);
  };
  return "'" + escaped(line(saved)) + "' there and '" + escaped(line(own)) + "' here";
}

void require_same_plan(const Blob& blob, const Identity& own, bool other_settings) {
  const BlobHead& head = blob.head;
  if (head.plan_hash == own.plan) return;
  const bool same_model = head.model_hash == own.model;
  if (same_model && other_settings) return;
  const std::string rule = "was saved by lockstep " + escaped(blob.version) + " for plan " + hex(head.plan_hash) +
                           ", and this batch has plan " + hex(own.plan);
  if (same_model)
    throw UsageError("blob",
                     rule + ": the model is the same, the first setting that differs is " +
                         first_difference(blob.settings, own.settings),
                     "compile with the same settings, or allow RestoreOptions::other_settings");
  throw UsageError("blob",
                   rule + ": the models differ, " + hex(head.model_hash) + " there and " + hex(own.model) + " here",
                   "compile the model that it was saved for");
}

// Enumerators and dofs of a blob are used as such, so they must be some.
bool is_known(Fault fault, int) { return static_cast<unsigned>(fault) < fault_count; }
bool is_known(const FaultPlace& place, int dofs) {
  return static_cast<unsigned>(place.stage) < fault_stage_count && place.dof >= -1 && place.dof < dofs;
}

}  // namespace

// What is saved of a batch: all rows but results and readings.
template <class S>
auto Batch<S>::Impl::saved_rows() const -> std::vector<SavedRows> {
  std::vector<SavedRows> all;
  each_block(
      tables,
      [&]<class E>(const BatchBlock& block, const AlignedBlock<E>& own) {
        if (block.kind == RowKind::result || block.kind == RowKind::reading) return;
        SavedRows saved{block.parameter < 0 ? block.name : to_string(Parameter(block.parameter)),
                        block.kind,
                        block.rows,
                        sizeof(E),
                        reinterpret_cast<std::byte*>(own.data()),
                        nullptr};
        if constexpr (std::is_same_v<E, Fault> || std::is_same_v<E, FaultPlace>)
          saved.is_known = [](const std::byte* number, int dofs) {
            E value;
            std::memcpy(&value, number, sizeof value);
            return is_known(value, dofs);
          };
        all.push_back(std::move(saved));
      },
      rows);
  return all;
}

template <class S>
std::vector<std::byte> Batch<S>::save() const {
  return save(first_ids(static_cast<std::size_t>(environments())));
}

template <class S>
std::vector<std::byte> Batch<S>::save(std::span<const int> ids) const {
  const Impl& batch = impl();
  const Alone alone(impl().in_use);
  for (const int id : ids) batch.check_id(id);
  const Identity& identity = identity_of(program_of(batch.plan));
  BlobHead head;
  head.plan_hash = identity.plan, head.model_hash = identity.model;
  head.scalar_bytes = sizeof(S), head.environments = static_cast<std::uint32_t>(ids.size());
  std::strncpy(head.version.data(), version(), head.version.size() - 1);
  auto rows = batch.saved_rows();
  std::erase_if(rows, [](const auto& own) { return own.rows == 0; });
  std::vector<BlobSection> sections(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::strncpy(sections[i].name.data(), rows[i].name.c_str(), sections[i].name.size() - 1);
    sections[i].rows = static_cast<std::uint32_t>(rows[i].rows);
    sections[i].number_bytes = static_cast<std::uint32_t>(rows[i].number_bytes);
  }
  const std::vector<int> places = first_ids(ids.size());
  return write_blob(head, identity.settings, std::move(sections), [&](std::size_t i, std::byte* to) {
    const std::size_t bytes = rows[i].number_bytes;
    for (int row = 0; row < rows[i].rows; ++row, to += ids.size() * bytes)
      copy_row(bytes, rows[i].data + static_cast<std::size_t>(row * batch.stride) * bytes, ids, to, places);
  });
}

// Checks everything before it writes anything.
template <class S>
void Batch<S>::Impl::restore(const Blob& blob, std::span<const int> into, std::span<const int> from,
                             bool other_settings) {
  // The blob as a whole, and the environments to restore.
  if (blob.head.scalar_bytes != sizeof(S))
    throw UsageError("blob",
                     "holds numbers of " + std::to_string(blob.head.scalar_bytes) + " bytes, and this batch of " +
                         std::to_string(sizeof(S)),
                     blob.head.scalar_bytes == 4 ? "use Batch<float>" : "use Batch<double>");
  const Identity& own = identity_of(program_of(plan));
  require_same_plan(blob, own, other_settings);
  const int saved = static_cast<int>(blob.head.environments);
  if (into.size() != from.size())
    throw UsageError("blob", "gives " + std::to_string(from.size()) + " environments to " + std::to_string(into.size()),
                     "list as many to restore as to take, or restore into a batch of that size");
  for (const int id : into) check_id(id);
  for (const int id : from)
    if (id < 0 || id >= saved)
      throw UsageError("environment " + std::to_string(id) + " of the blob",
                       "is outside the " + std::to_string(saved) + " that it holds",
                       "give 0 to " + std::to_string(saved - 1));

  // What the library keeps between steps goes with the settings: under other ones it begins anew, as after a reset.
  const bool same_settings = blob.head.plan_hash == own.plan;
  const std::vector<SavedRows> rows = saved_rows();
  std::vector<const SavedRows*> targets;
  for (const Blob::Section& section : blob.sections) {
    const auto target =
        std::find_if(rows.begin(), rows.end(), [&](const SavedRows& r) { return section.name == r.name; });
    const std::string element = section_of_blob(section.name);
    if (target == rows.end() || (target->rows == 0 && target->kind == RowKind::field))
      throw UsageError(element, "has no place in this batch", "declare the field in StepSettings::per_environment");
    const bool anew = target->kind == RowKind::memory && !same_settings;
    targets.push_back(anew ? nullptr : &*target);
    if (anew) continue;
    if (target->rows != section.rows || target->number_bytes != section.number_bytes)
      throw UsageError(element,
                       "has " + std::to_string(section.rows) + " rows, and this batch " + std::to_string(target->rows),
                       "use the same StepSettings::stage_inputs and integrator");
    const std::byte* number = section.data;
    for (int e = 0; target->is_known && e < saved; ++e, number += section.number_bytes)
      if (!target->is_known(number, tables.joints))
        throw UsageError(element, "names for environment " + std::to_string(e) + " what this plan does not have",
                         whole_blob);
  }

  // No section is missing.
  for (const SavedRows& own_rows : rows)
    if (same_settings && own_rows.rows > 0 &&
        std::none_of(blob.sections.begin(), blob.sections.end(),
                     [&](const Blob::Section& section) { return section.name == own_rows.name; }))
      throw UsageError(section_of_blob(own_rows.name), "is missing", "restore it by the library that saved it");

  // Nothing is wrong, so write.
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (!targets[i]) continue;
    const Blob::Section& section = blob.sections[i];
    const std::size_t bytes = section.number_bytes;
    for (int row = 0; row < section.rows; ++row)
      copy_row(bytes, section.data + static_cast<std::size_t>(row) * static_cast<std::size_t>(saved) * bytes, from,
               targets[i]->data + static_cast<std::size_t>(row * stride) * bytes, into);
  }
  for (const int id : into) {
    const auto begins = [&](RowKind kind) {
      return kind == RowKind::reading || (kind == RowKind::memory && !same_settings);
    };
    begin(id, begins, start);
    if (!same_settings) settle_drives(id);
  }
}

template <class S>
void Batch<S>::restore(std::span<const std::byte> bytes, const RestoreOptions& options) {
  restore(bytes, first_ids(static_cast<std::size_t>(environments())), {}, options);
}

template <class S>
void Batch<S>::restore(std::span<const std::byte> bytes, std::span<const int> into, std::span<const int> from,
                       const RestoreOptions& options) {
  const Alone alone(impl().in_use);
  const Blob blob = read_blob(bytes);
  if (!from.empty() || into.empty()) return impl().restore(blob, into, from, options.other_settings);
  impl().restore(blob, into, first_ids(blob.head.environments), options.other_settings);
}

template <class S>
void Batch<S>::copy(int from, const EnvironmentSet& to) {
  Impl& batch = impl();
  const Alone alone(batch.in_use);
  batch.check_id(from);
  to.check(batch.environments);
  each_block(
      batch.tables,
      [&]<class E>(const BatchBlock& block, const AlignedBlock<E>& own) {
        if (block.kind == RowKind::label) return;
        for (int row = 0; row < block.rows; ++row) {
          E* const numbers = own.data() + row * batch.stride;
          to.for_each(batch.environments, [&](int e) { numbers[e] = numbers[from]; });
        }
      },
      batch.rows);
}

template void Batch<float>::Impl::restore(const Blob&, std::span<const int>, std::span<const int>, bool);
template void Batch<double>::Impl::restore(const Blob&, std::span<const int>, std::span<const int>, bool);
template std::vector<std::byte> Batch<float>::save() const;
template std::vector<std::byte> Batch<double>::save() const;
template std::vector<std::byte> Batch<float>::save(std::span<const int>) const;
template std::vector<std::byte> Batch<double>::save(std::span<const int>) const;
template void Batch<float>::restore(std::span<const std::byte>, const RestoreOptions&);
template void Batch<double>::restore(std::span<const std::byte>, const RestoreOptions&);
template void Batch<float>::restore(std::span<const std::byte>, std::span<const int>, std::span<const int>,
                                    const RestoreOptions&);
template void Batch<double>::restore(std::span<const std::byte>, std::span<const int>, std::span<const int>,
                                     const RestoreOptions&);
template void Batch<float>::copy(int, const EnvironmentSet&);
template void Batch<double>::copy(int, const EnvironmentSet&);

}  // namespace lockstep
