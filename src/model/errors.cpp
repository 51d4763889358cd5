// The codes of errors and faults. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <string_view>

#include "lockstep/error.h"

namespace lockstep {
namespace {

constexpr std::size_t most_kinds = 6;

// A code, what it stands for, what to do, and what kinds of elements it has: the words by which an element begins, in
// errors of the model those before its name in quotes. The first that fits counts, and the class alone comes last of
// its class. Codes are never changed or used for something else; new ones may be added before their class.
struct Entry {
  ErrorCode code;
  std::array<std::string_view, most_kinds> kinds = {};
};

constexpr Entry entries[] = {
    {{"model.link", "a link: its name, inertia, place in the tree",
      "name it once, give it an inertia that a body can have and a joint that carries it; for files see `--fix`, "
      "`--least-mass` and `--repair-inertias`"},
     {"link"}},
    {{"model.joint", "a joint: its name, kind, axis, ends, limits, drive, start",
      "correct what the rule names; a joint that is not there is misspelt or comes later"},
     {"joint"}},
    {{"model.coupling", "a coupling: its joints, ratios, softness; couplings that contradict each other",
      "correct its joints and ratios; of couplings that contradict each other make one soft, or remove it"},
     {"coupling"}},
    {{"model.site", "a site: its name, link, pose", "name it once, on a link that is there"}, {"site"}},
    {{"model.collider", "a collider: its name, link, shape, pose, friction, restitution",
      "give its shape sizes above 0 and a link that is there"},
     {"collider"}},
    {{"model.contact", "a pair of colliders, or groups of them, that may touch",
      "name colliders or groups that are there and can move against each other"},
     {"contact"}},
    {{"model.root", "a root of a tree: its link, pose, velocity",
      "name a root link of a tree, and a pose and velocity of finite numbers"},
     {"root"}},
    {{"model.whole", "the model as a whole: no links, gravity, links that nothing carries",
      "add links, or connect those that nothing carries; give finite gravity; split what is too large"},
     {"model"}},
    {{"model", "the mechanism is impossible or incomplete in another way",
      "read the rule: it names the element and what is wrong with it"}},
    {{"import", "a file cannot be read as a mechanism; file and, where known, line are named",
      "correct the file at that line; `lockstep info FILE --fix` finds options that read it"}},
    {{"settings.dt", "StepSettings::dt", "give 1e-9 to 1000 s, such as 1.0 / 240"}, {"dt"}},
    {{"settings.method", "StepSettings::method, or one that does not apply to this model",
      "take Method::automatic, or one that `Plan::describe()` allows"},
     {"method"}},
    {{"settings.integrator", "StepSettings::integrator, or one that does not apply to this model",
      "take Integrator::automatic, or one that `Plan::describe()` allows"},
     {"integrator"}},
    {{"settings.iterations", "StepSettings::iterations", "give 1 to 1000"}, {"iterations"}},
    {{"settings.velocity_iterations", "StepSettings::velocity_iterations", "give 0 to 1000"}, {"velocity_iterations"}},
    {{"settings.per_environment", "StepSettings::per_environment",
      "leave the field out, or what the rule names beside it"},
     {"per_environment"}},
    {{"settings.ignore", "StepSettings::ignore, ImportOptions::ignore", "name moving joints of the model"},
     {"ignore", "ImportOptions::ignore"}},
    {{"settings.guard", "StepSettings::guard", "give a number above 0, or infinity to switch it off"}, {"guard"}},
    {{"settings.contacts", "StepSettings::contacts, or another setting beside contacts",
      "give numbers in the ranges of ContactSettings; leave out what the rule names beside contacts"},
     {"contacts", "contact_settings"}},
    {{"settings.position_bound", "StepSettings::position_bound", "give a number above 0"}, {"position_bound"}},
    {{"settings.velocity_bound", "StepSettings::velocity_bound", "give a number above 0"}, {"velocity_bound"}},
    {{"settings.stage_inputs", "StepSettings::stage_inputs", "hold inputs over the step"}, {"stage_inputs"}},
    {{"settings.record",
      "StepSettings::record_impulses, record_diagnostics, record_efforts, record_contacts or record_accelerations",
      "leave out one of the two that the rule names"},
     {"record_impulses", "record_diagnostics", "record_efforts", "record_contacts", "record_accelerations"}},
    {{"settings.environments", "the number of environments of a batch",
      "give 1 or more, as many as there is memory for"},
     {"environments"}},
    {{"settings.threads", "BatchOptions::threads",
      "give 0 (as many as the process may use), 1, or a number of threads"},
     {"threads"}},
    {{"settings.memory_domain", "BatchOptions::memory_domain",
      "give -1, or a domain that this process sees; oneTBB sees them if it finds hwloc"},
     {"memory_domain"}},
    {{"settings.target", "BatchOptions::target, LOCKSTEP_TARGET",
      "take Target::automatic, or one that supported() allows"},
     {"target", "LOCKSTEP_TARGET"}},
    {{"settings.engine", "BatchOptions::engine, or one that does not take this plan",
      "take Engine::automatic; `Plan::describe()` says why the engine does not apply"},
     {"engine"}},
    {{"settings.precision", "float or double: precision, dtype", "give float or double, 'f4' or 'f8'"},
     {"precision", "dtype"}},
    {{"settings.kernel", "a generated kernel that is to be written",
      "give a name and a precision; `Plan::describe()` says what has no kernel"},
     {"kernel"}},
    {{"settings.import", "another member of ImportOptions",
      "give the option a number in its range, or a name that the file has"},
     {"ImportOptions"}},
    {{"settings.export", "a member of MjcfOptions", "give a number in its range"}, {"MjcfOptions"}},
    {{"settings", "another setting is out of its range, or does not apply to this model",
      "read the rule: it names the setting and its range"}},
    {{"usage.save", "bytes of Batch::save() that restore() does not take",
      "give the bytes of save() unchanged, to a batch of the same plan; see RestoreOptions"},
     {"blob", "section"}},
    {{"usage.rank", "which of several processes this is, or which environments are whose",
      "give each rank the range that `ids_of()` gives it"},
     {"rank", "ids of ranks", "ids of the batch"}},
    {{"usage.checkpoint", "a checkpoint that cannot be written, or that is not what was written",
      "go on from the one before; free room on the disk"},
     {"checkpoint"}},
    {{"usage.environment", "an environment, or a mask or list of them, that does not fit the batch",
      "give numbers from 0 to one below the batch's, or a mask of its length"},
     {"environment", "mask"}},
    {{"usage.batch", "a batch that is in use, or was moved from",
      "call its functions one after the other; make a new one for what was moved or freed"},
     {"batch"}},
    {{"usage.field", "a field per environment that is none, or was not declared",
      "declare it in StepSettings::per_environment, and keep values in the ranges of Parameter"},
     {"field"}},
    {{"usage.actions", "actions, their range, kind or joint",
      "give [actions] x [environments] in the order of the driven dofs"},
     {"actions", "of actions"}},
    {{"usage.query", "a query: its quantity, elements, scale, memory",
      "name elements of the plan, and give rows for all of the query"},
     {"query", "quantity", "scale of query", "memory of the queries", "element", "row of query"}},
    {{"usage.draw", "random numbers: stream, distribution, range, memory",
      "give a distribution with finite numbers and room for its draws"},
     {"stream", "distribution", "memory of the draws", "of the randomization"}},
    {{"usage.link", "a link that the plan does not have", "see Plan::model() for its names"}, {"link"}},
    {{"usage.joint", "a joint or dof that the plan does not have", "see Plan::dof_names()"}, {"joint", "dof"}},
    {{"usage.site", "a site that the plan does not have", "add it by Model::add_site() before compile()"}, {"site"}},
    {{"usage.contact", "a contact that the plan does not have", "see Plan::contacts()"}, {"contact"}},
    {{"usage.precision", "a model with numbers beyond single precision",
      "use Batch<double>, or scale the model's numbers"},
     {"numbers of model"}},
    {{"usage.recorded", "diagnostics or impulses that the plan does not record",
      "switch on StepSettings::record_diagnostics or record_impulses"},
     {"diagnostics", "coupling impulses"}},
    {{"usage.state", "a state to reset to, or couplings by which to place followers",
      "give one position and velocity per dof, finite and within its bounds"},
     {"reset state", "couplings"}},
    {{"usage.kernel", "a file or kernel that cannot be loaded",
      "build it by lockstep_add_kernel() of the same version"},
     {"kernel"}},
    {{"usage.file", "a file that cannot be written or loaded", "check the path, its permissions and the disk"},
     {"file"}},
    {{"usage", "a plan or batch was asked for something else that it does not hold",
      "read the rule: it names what was asked for"}},
    {{"memory", "there is not enough memory: std::bad_alloc in C++, MemoryError in Python",
      "ask for fewer environments, or free memory"}},
    {{"internal", "a bug of the library", "report it, with the model"}},
    {{"fault.not_finite", "the step would have left a position or velocity that is NaN or infinite",
      "look at the inputs, then take a smaller dt; reset the environment"}},
    {{"fault.diverged",
      "the step would have left a position, velocity or number of turns beyond its bound, or a tendon's length far off",
      "look at gains and inputs, then take a smaller dt, or a larger position_bound or velocity_bound"}},
    {{"fault.singular", "the mass matrix is not positive definite or not finite",
      "look at masses and parameters: some joint has no inertia to move"}},
    {{"fault.bad_value", "a field has a value that no model could have, or a root's quaternion is 0",
      "keep parameters in the ranges of Parameter; Batch::explain_fault() names the row"}},
    {{"fault.too_fast", "the motion is too fast for the step, so its energy would not be right",
      "take a smaller dt, leapfrog, or more damping; ten times StepSettings::guard is the threshold"}},
    {{"fault.bad_input", "an action was NaN", "give finite actions"}},
};

constexpr auto codes = [] {
  std::array<ErrorCode, std::size(entries)> all{};
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = entries[i].code;
  return all;
}();

bool is_of(std::string_view element, std::string_view kind, bool behind_place) {
  const std::string_view words = element.substr(0, element.find(" '"));
  if (kind.starts_with("of ")) return words.ends_with(kind);  // whatever of it
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
