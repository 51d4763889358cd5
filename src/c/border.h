// What the functions of lockstep/c.h share: handles, failures, checked arguments. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstring>
#include <mutex>
#include <new>
#include <variant>

#include "handles.h"
#include "lockstep/c.h"
#include "lockstep/lockstep.h"

struct lockstep_model {
  lockstep_model(lockstep::Model own, std::string lines) : model(std::move(own)), report(std::move(lines)) {}
  lockstep::Model model;
  std::string report;  // of the importer, line by line
};

struct lockstep_plan {
  lockstep_plan(lockstep::Plan compiled, std::vector<std::string> names)
      : plan(std::move(compiled)), couplings(std::move(names)) {}
  lockstep::Plan plan;
  std::vector<std::string> couplings;
  std::once_flag described;
  std::string description;
};

struct lockstep_batch {
  std::variant<std::unique_ptr<lockstep::Batch<float>>, std::unique_ptr<lockstep::Batch<double>>> batch;

  template <class Use>
  decltype(auto) use(Use&& use) const {
    return std::visit([&](const auto& own) -> decltype(auto) { return use(*own); }, batch);
  }
};

namespace lockstep::c {

/// Keeps the words for lockstep_message() and the code for lockstep_code(), and returns the status.
int failed(int status, const char* words, const char* code) noexcept;
inline int failed(int status, const Error& error) noexcept { return failed(status, error.what(), error.code()); }

// Runs a function and turns what it throws into a status.
template <class Function>
int guarded(Function&& function) noexcept {
  try {
    function();
    return LOCKSTEP_OK;
  } catch (const ModelError& error) {
    return failed(LOCKSTEP_MODEL_ERROR, error);
  } catch (const ImportError& error) {
    return failed(LOCKSTEP_IMPORT_ERROR, error);
  } catch (const SettingsError& error) {
    return failed(LOCKSTEP_SETTINGS_ERROR, error);
  } catch (const UsageError& error) {
    return failed(LOCKSTEP_USAGE_ERROR, error);
  } catch (const std::bad_alloc&) {
    return failed(LOCKSTEP_MEMORY_ERROR, "memory: there is not enough; free some, or use a smaller batch", "memory");
  } catch (const std::exception& error) {
    return failed(LOCKSTEP_INTERNAL_ERROR, error.what(), "internal");
  } catch (...) {
    return failed(LOCKSTEP_INTERNAL_ERROR, "an unknown exception", "internal");
  }
}

/// What programs hold. These are never destroyed, so a program may free objects as it ends.
inline Handles<lockstep_model>& models() {
  static auto& all = *new Handles<lockstep_model>(0xa1, "model");
  return all;
}
inline Handles<lockstep_plan>& plans() {
  static auto& all = *new Handles<lockstep_plan>(0xa2, "plan");
  return all;
}
inline Handles<lockstep_batch>& batches() {
  static auto& all = *new Handles<lockstep_batch>(0xa3, "batch");
  return all;
}

/// Frees an object. What is none is left alone; lockstep_message() then has the words.
template <class Object>
void end(Handles<Object>& all, const Object* handle, const char* name) noexcept {
  if (handle) guarded([&] { all.free(handle, name); });
}

template <class Pointer>
Pointer given(Pointer pointer, const char* name) {
  if (!pointer) throw UsageError(name, "is null", "give an object");
  return pointer;
}

// A struct that a program filled: as much of it as both sides know, the rest as _init leaves it.
template <class Struct>
Struct known(const Struct* from, void (*initialise)(Struct*), const char* name) {
  Struct own;
  initialise(&own);
  if (!from) return own;
  if (from->size < 2 * sizeof(uint32_t) || from->size > 4096)
    throw UsageError(name, "has the size " + std::to_string(from->size), "fill it by its _init function first");
  std::memcpy(&own, from, std::min<std::size_t>(from->size, sizeof own));
  const auto* bytes = reinterpret_cast<const unsigned char*>(from);
  for (std::size_t i = sizeof own; i < from->size; ++i)
    if (bytes[i] != 0)
      throw UsageError(name, "has members that this version does not know", "set them to 0, or use a newer library");
  return own;
}

template <class Enum>
Enum enumerator(const char* setting, const char* name, Enum last) {
  for (int i = 0; i <= static_cast<int>(last); ++i)
    if (name && std::strcmp(name, to_string(static_cast<Enum>(i))) == 0) return static_cast<Enum>(i);
  throw SettingsError(setting, name ? "'" + std::string(name) + "' is unknown" : "is null", "see lockstep/c.h");
}

template <class Enum>
Enum numbered(const char* name, int32_t number, Enum last) {
  if (number < 0 || number > static_cast<int32_t>(last))
    throw UsageError(std::string(name) + " " + std::to_string(number), "is none of the enumerators",
                     "see lockstep/c.h");
  return static_cast<Enum>(number);
}

inline void require_count(int64_t n) {
  if (n < 0) throw UsageError("n", "is " + std::to_string(n), "give the number of entries");
}

/// No other bits than those of `allowed`.
inline void require_bits(int64_t value, int64_t allowed, const char* name) {
  if ((value & ~allowed) != 0)
    throw UsageError(name, "is " + std::to_string(value), "set it to 0, or to what lockstep/c.h lists");
}

inline bool truth(int32_t value, const char* name) {
  require_bits(value, 1, name);
  return value != 0;
}

/// A mask, or all environments.
inline EnvironmentSet environments(const uint8_t* mask, int64_t n) {
  require_count(n);
  if (!mask && n == 0) return EnvironmentSet::all();
  return EnvironmentSet(std::span<const uint8_t>(given(mask, "mask"), static_cast<std::size_t>(n)));
}

template <class S>
constexpr int32_t type_of = sizeof(S) == 4 ? LOCKSTEP_F32 : LOCKSTEP_F64;

/// An array of a caller as rows: [rows][environments].
template <class S>
StridedRows<S> rows_of(const lockstep_array* array, int64_t rows, int64_t environments, const char* name) {
  given(array, name);
  constexpr int64_t item = sizeof(S);
  if (array->type != type_of<std::remove_const_t<S>> || array->rank != 2)
    throw UsageError(name, "has another type or rank than the batch", "give two dimensions of the batch's precision");
  if (array->shape[0] != rows || array->shape[1] != environments)
    throw UsageError(name, "has the shape " + std::to_string(array->shape[0]) + " x " + std::to_string(array->shape[1]),
                     "give " + std::to_string(rows) + " rows x " + std::to_string(environments) + " environments");
  if (array->stride[0] % item != 0 || array->stride[1] % item != 0 ||
      reinterpret_cast<std::uintptr_t>(array->data) % item != 0)
    throw UsageError(name, "has data or strides that are no multiples of its numbers", "align the numbers");
  if (!std::is_const_v<S> && (array->flags & LOCKSTEP_READ_ONLY) != 0)
    throw UsageError(name, "is read-only", "give memory to write to");
  return {static_cast<S*>(given(array->data, name)), array->stride[0] / item, array->stride[1] / item};
}

/// Of queries one after the other, each as large as it says (batch.cpp).
std::vector<Query> queries_of(const lockstep_query* queries, int64_t count);

}  // namespace lockstep::c
