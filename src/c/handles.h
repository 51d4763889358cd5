// The handles by which C programs hold objects. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <vector>

#include "lockstep/error.h"

namespace lockstep::c {

/// Objects of one kind. A handle is a number in a pointer's place: the kind, how often its slot was freed, and the
/// slot. So one that was freed, one of another kind, and a number that never was one are errors. Thread-safe; an object
/// that one thread uses while another frees it is the program's error.
template <class Object>
class Handles {
 public:
  /// `kind` is another number, 1 to 255, for each type.
  Handles(std::uint64_t kind, const char* name) : kind_(kind), name_(name) {}

  Object* add(std::unique_ptr<Object> object) {
    const std::lock_guard lock(mutex_);
    std::uint64_t slot = slots_.size();
    if (!free_.empty())
      slot = free_.back(), free_.pop_back();
    else if (slot <= last_slot)
      slots_.emplace_back();
    else
      throw std::bad_alloc();
    slots_[slot].object = std::move(object);
    return reinterpret_cast<Object*>(kind_ << 56 | slots_[slot].freed << 24 | slot);
  }

  /// The object. Throws UsageError where there is none; `argument` names the handle.
  Object& at(const Object* handle, const char* argument) const {
    const std::lock_guard lock(mutex_);
    return *slots_[slot_of(handle, argument)].object;
  }

  /// Throws UsageError where there is none.
  void free(const Object* handle, const char* argument) {
    std::unique_ptr<Object> last;  // ends without the lock
    const std::lock_guard lock(mutex_);
    const std::uint64_t slot = slot_of(handle, argument);
    free_.reserve(slots_.size());
    last = std::move(slots_[slot].object);
    ++slots_[slot].freed;
    if (slots_[slot].freed < most_freed) free_.push_back(slot);
  }

 private:
  static_assert(sizeof(void*) == 8);
  static constexpr std::uint64_t last_slot = 0xffffff, most_freed = 0xffffffff;

  struct Slot {
    std::unique_ptr<Object> object;
    std::uint64_t freed = 0;
  };

  std::uint64_t slot_of(const Object* handle, const char* argument) const {
    if (!handle) throw UsageError(argument, "is null", "give an object");
    const auto number = reinterpret_cast<std::uint64_t>(handle);
    const std::uint64_t slot = number & last_slot, freed = number >> 24 & most_freed;
    if (number >> 56 != kind_ || slot >= slots_.size() || freed > slots_[slot].freed)
      throw UsageError(argument, std::string("is no ") + name_ + " of this library",
                       "give what the library returned for one");
    if (freed < slots_[slot].freed || !slots_[slot].object)
      throw UsageError(argument, std::string("is a ") + name_ + " that was freed", "free it after its last use");
    return slot;
  }

  const std::uint64_t kind_;
  const char* const name_;
  mutable std::mutex mutex_;
  std::vector<Slot> slots_;
  std::vector<std::uint64_t> free_;
};

}  // namespace lockstep::c
