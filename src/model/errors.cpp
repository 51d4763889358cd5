// The codes of errors and faults. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <string_view>

#include "lockstep/error.h"

namespace lockstep {
namespace {

constexpr std::size_t most_kinds = 5;

// A code, what it stands for, and what kinds of elements it has: the words by which an element begins, in errors of the
// model those before its name in quotes. The first that fits counts, and the class alone comes last of its class.
// Codes are never changed or used for something else; new ones may be added before their class.
struct Entry {
  ErrorCode code;
  std::array<std::string_view, most_kinds> kinds = {};
};

constexpr Entry entries[] = {
    {{"model.link", "a link: its name, inertia, place in the tree"}, {"link"}},
    {{"model.joint", "a joint: its name, kind, axis, ends, limits, drive, start"}, {"joint"}},
    {{"model.coupling", "a coupling: its joints, ratios, softness; couplings that contradict each other"},
     {"coupling"}},
    {{"model.site", "a site: its name, link, pose"}, {"site"}},
    {{"model.collider", "a collider: its name, link, shape, pose, friction, restitution"}, {"collider"}},
    {{"model.contact", "a pair of colliders, or groups of them, that may touch"}, {"contact"}},
    {{"model.root", "a root of a tree: its link, pose, velocity"}, {"root"}},
    {{"model.whole", "the model as a whole: no links, gravity, links that nothing carries"}, {"model"}},
    {{"model", "the mechanism is impossible or incomplete in another way"}},
    {{"import", "a file cannot be read as a mechanism; file and, where known, line are named"}},
    {{"settings.dt", "StepSettings::dt"}, {"dt"}},
    {{"settings.method", "StepSettings::method, or one that does not apply to this model"}, {"method"}},
    {{"settings.integrator", "StepSettings::integrator, or one that does not apply to this model"}, {"integrator"}},
    {{"settings.iterations", "StepSettings::iterations"}, {"iterations"}},
    {{"settings.velocity_iterations", "StepSettings::velocity_iterations"}, {"velocity_iterations"}},
    {{"settings.per_environment", "StepSettings::per_environment"}, {"per_environment"}},
    {{"settings.ignore", "StepSettings::ignore, ImportOptions::ignore"}, {"ignore", "ImportOptions::ignore"}},
    {{"settings.guard", "StepSettings::guard"}, {"guard"}},
    {{"settings.contacts", "StepSettings::contacts, or another setting beside contacts"},
     {"contacts", "contact_settings"}},
    {{"settings.position_bound", "StepSettings::position_bound"}, {"position_bound"}},
    {{"settings.velocity_bound", "StepSettings::velocity_bound"}, {"velocity_bound"}},
    {{"settings.stage_inputs", "StepSettings::stage_inputs"}, {"stage_inputs"}},
    {{"settings.record",
      "StepSettings::record_impulses, record_diagnostics, record_efforts, record_contacts or record_accelerations"},
     {"record_impulses", "record_diagnostics", "record_efforts", "record_contacts", "record_accelerations"}},
    {{"settings.environments", "the number of environments of a batch"}, {"environments"}},
    {{"settings.threads", "BatchOptions::threads"}, {"threads"}},
    {{"settings.target", "BatchOptions::target, LOCKSTEP_TARGET"}, {"target", "LOCKSTEP_TARGET"}},
    {{"settings.engine", "BatchOptions::engine, or one that does not take this plan"}, {"engine"}},
    {{"settings.precision", "float or double: precision, dtype"}, {"precision", "dtype"}},
    {{"settings.kernel", "a generated kernel that is to be written"}, {"kernel"}},
    {{"settings.import", "another member of ImportOptions"}, {"ImportOptions"}},
    {{"settings.export", "a member of MjcfOptions"}, {"MjcfOptions"}},
    {{"settings", "another setting is out of its range, or does not apply to this model"}},
    {{"usage.save", "bytes of Batch::save() that restore() does not take"}, {"blob", "section"}},
    {{"usage.environment", "an environment, or a mask or list of them, that does not fit the batch"},
     {"environment", "mask"}},
    {{"usage.batch", "a batch that is in use, or was moved from"}, {"batch"}},
    {{"usage.field", "a field per environment that is none, or was not declared"}, {"field"}},
    {{"usage.actions", "actions, their range, kind or joint"}, {"actions", "range of actions", "kind of actions"}},
    {{"usage.query", "a query: its quantity, elements, scale, memory"},
     {"query", "quantity", "scale of query", "memory of the queries"}},
    {{"usage.draw", "random numbers: stream, distribution, range, memory"},
     {"stream", "distribution", "memory of the draws"}},
    {{"usage.link", "a link that the plan does not have"}, {"link"}},
    {{"usage.joint", "a joint or dof that the plan does not have"}, {"joint", "dof"}},
    {{"usage.site", "a site that the plan does not have"}, {"site"}},
    {{"usage.contact", "a contact that the plan does not have"}, {"contact"}},
    {{"usage.precision", "a model with numbers beyond single precision"}, {"model"}},
    {{"usage.recorded", "diagnostics or impulses that the plan does not record"}, {"diagnostics", "coupling impulses"}},
    {{"usage.state", "a state to reset to, or couplings by which to place followers"}, {"reset state", "couplings"}},
    {{"usage.kernel", "a file or kernel that cannot be loaded"}, {"kernel"}},
    {{"usage.file", "a file that cannot be written or loaded"}, {"file"}},
    {{"usage", "a plan or batch was asked for something else that it does not hold"}},
    {{"memory", "there is not enough memory: std::bad_alloc in C++, MemoryError in Python"}},
    {{"internal", "a bug of the library"}},
    {{"fault.not_finite", "the step would have left a position or velocity that is NaN or infinite"}},
    {{"fault.diverged", "the step would have left a position, velocity or number of turns beyond its bound"}},
    {{"fault.singular", "the mass matrix is not positive definite or not finite"}},
    {{"fault.bad_value", "a field has a value that no model could have, or a root's quaternion is 0"}},
    {{"fault.too_fast", "the motion is too fast for the step, so its energy would not be right"}},
    {{"fault.bad_input", "an action was NaN"}},
};

constexpr auto codes = [] {
  std::array<ErrorCode, std::size(entries)> all{};
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = entries[i].code;
  return all;
}();

bool is_of(std::string_view element, std::string_view kind, bool behind_place) {
  const std::string_view words = element.substr(0, element.find(" '"));
  if (behind_place && words.size() > kind.size())
    return words.ends_with(kind) && words[words.size() - kind.size() - 1] == ' ';
  if (!words.starts_with(kind)) return false;
  const char next = words.size() > kind.size() ? words[kind.size()] : ' ';
  return next == ' ' || next == ':' || next == '.';
}

const char* code_of_error(std::string_view group, std::string_view element) {
  for (const Entry& entry : entries) {
    const std::string_view code = entry.code.code;
    if (!code.starts_with(group)) continue;
    if (code == group) return entry.code.code;
    for (const std::string_view kind : entry.kinds)
      if (!kind.empty() && is_of(element, kind, group == "model")) return entry.code.code;
  }
  return "internal";
}

// A line for each.
std::string message_of(const std::vector<Reason>& reasons) {
  std::string message;
  for (const Reason& reason : reasons)
    message += (message.empty() ? "" : "\n") + reason.element + ": " + reason.rule + "; " + reason.remedy;
  return message;
}

}  // namespace

Error::Error(const char* group, std::vector<Reason> reasons)
    : std::runtime_error(message_of(reasons)),
      reasons_(std::move(reasons)),
      code_(code_of_error(group, reasons_.front().element)) {}

std::span<const ErrorCode> error_codes() noexcept { return codes; }

const char* code_of(Fault fault) noexcept {
  const std::string_view name = to_string(fault);
  const auto entry = std::find_if(codes.begin(), codes.end(), [&](const ErrorCode& known) {
    const std::string_view code = known.code;
    return code.starts_with("fault.") && code.substr(6) == name;
  });
  return entry == codes.end() ? "" : entry->code;
}

}  // namespace lockstep
