// <actuator>: each as a linear force along a joint or a tendon. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <string_view>

#include "scene.h"

namespace lockstep::importer::mjcf {
namespace {

const std::vector<std::string_view> tags = {"general", "motor",    "position", "velocity", "intvelocity",
                                            "damper",  "cylinder", "muscle",   "adhesion"};

// In the order of the words below. What follows a filter is not linear.
enum class Dynamics { none, integrator, filter, filterexact, muscle, dcmotor, pid, user };
enum class Gain { fixed, affine, muscle, dcmotor, so3, pid, user };
enum class Bias { none, affine, muscle, dcmotor, so3, user };

// What all tags of a class write into, one after the other, as in MuJoCo.
struct Numbers {
  Dynamics dynamics = Dynamics::none;
  Gain gain_type = Gain::fixed;
  Bias bias_type = Bias::none;
  double gain[10] = {1.0}, bias[10] = {}, dynamic[10] = {1.0};

  void servo() { gain_type = Gain::fixed, bias_type = Bias::affine; }
};

// A tag by itself, without the layers below it: they were written before.
void write(const Element& element, Numbers& numbers) {
  const std::string tag = element.tag();
  if (tag == "general") {
    numbers.dynamics = static_cast<Dynamics>(
        element.word("dyntype", {"none", "integrator", "filter", "filterexact", "muscle", "dcmotor", "pid", "user"},
                     static_cast<int>(numbers.dynamics)));
    numbers.gain_type =
        static_cast<Gain>(element.word("gaintype", {"fixed", "affine", "muscle", "dcmotor", "so3", "pid", "user"},
                                       static_cast<int>(numbers.gain_type)));
    numbers.bias_type = static_cast<Bias>(element.word(
        "biastype", {"none", "affine", "muscle", "dcmotor", "so3", "user"}, static_cast<int>(numbers.bias_type)));
    element.numbers("gainprm", numbers.gain, 1, 10);
    element.numbers("biasprm", numbers.bias, 1, 10);
    element.numbers("dynprm", numbers.dynamic, 1, 10);
  } else if (tag == "motor") {
    numbers.gain[0] = 1.0;
    numbers.dynamics = Dynamics::none, numbers.gain_type = Gain::fixed, numbers.bias_type = Bias::none;
  } else if (tag == "position" || tag == "intvelocity") {
    numbers.gain[0] = element.number("kp", numbers.gain[0]);
    numbers.bias[1] = -numbers.gain[0];
    const bool has_kv = element.has("kv"), has_ratio = element.has("dampratio");
    if (has_kv && has_ratio) element.fail("has kv and dampratio", "keep one of them");
    const double damping = element.number(has_kv ? "kv" : "dampratio", 0.0);
    if (damping < 0.0) element.fail("has a negative kv or dampratio", "give 0 or more");
    if (has_kv || has_ratio) numbers.bias[2] = has_kv ? -damping : damping;
    if (element.has("timeconst")) {
      numbers.dynamic[0] = element.number("timeconst");
      if (numbers.dynamic[0] < 0.0) element.fail("has a negative timeconst", "give 0 or more");
      numbers.dynamics = numbers.dynamic[0] == 0.0 ? Dynamics::none : Dynamics::filterexact;
    }
    if (tag == "intvelocity") numbers.dynamics = Dynamics::integrator;
    numbers.servo();
  } else if (tag == "velocity") {
    numbers.gain[0] = element.number("kv", numbers.gain[0]);
    std::fill(std::begin(numbers.bias), std::end(numbers.bias), 0.0);
    numbers.bias[2] = -numbers.gain[0];
    numbers.dynamics = Dynamics::none;
    numbers.servo();
  } else if (tag == "damper") {
    numbers.gain_type = Gain::affine;
  } else if (tag == "cylinder") {
    numbers.dynamics = Dynamics::filter;
    numbers.servo();
  } else {
    numbers.gain_type = Gain::muscle;
  }
}

// Why a linear force along a joint cannot stand for it; empty if it can.
std::string obstacle(const std::string& tag, const Numbers& numbers) {
  if (tag == "damper" || tag == "cylinder" || tag == "muscle" || tag == "adhesion")
    return (tag == "adhesion" ? "is an " : "is a ") + tag;
  if (numbers.gain_type != Gain::fixed) return "has a gain that is not fixed";
  if (numbers.bias_type > Bias::affine) return "has a bias that is not affine";
  if (numbers.dynamics > Dynamics::filterexact) return "has dynamics that are not linear";
  return "";
}

// MuJoCo takes one of several targets without a word.
void check_target(const Element& element) {
  const char* target = nullptr;
  for (const char* attribute : {"joint", "jointinparent", "tendon", "cranksite", "site", "body"}) {
    if (!element.has(attribute)) continue;
    if (target) element.fail(fmt::format("acts on a {} and on a {}", target, attribute), "keep one of them");
    target = attribute;
  }
}

void read_target(const Element& element, Scene& scene, Actuator& actuator) {
  check_target(element);
  for (const char* other : {"site", "body", "cranksite", "slidersite"})
    if (actuator.lost.empty() && element.has(other)) actuator.lost = fmt::format("acts on a {}", other);
  if (!actuator.lost.empty()) return;
  const char* joint = element.has("joint") ? "joint" : "jointinparent";
  if (element.has(joint)) {
    const std::string name = element.name(joint);
    const auto found = scene.joint_of.find(name);
    if (found == scene.joint_of.end()) scene.fail_to_find(element, "joint", name);
    const JointType type = scene.joint(found->second).type;
    if (type == JointType::free || (type == JointType::ball && !element.has("joint")))
      actuator.lost = type == JointType::free ? "acts on a free joint" : "acts on a ball joint along its parent's axes";
    else if (!scene.is_joint_read(found->second))
      actuator.lost = "acts on a body that is left out";
    else
      actuator.joint = found->second;
    return;
  }
  const std::string name = element.name("tendon", "");
  if (name.empty()) element.fail("acts on nothing", "write joint=\"...\" or tendon=\"...\"");
  const Tendon& tendon = scene.tendon(name, element);
  if (!tendon.is_whole)
    actuator.lost = "acts on a body that is left out";
  else
    actuator.tendon = static_cast<int>(&tendon - scene.tendons.data());
}

// On a ball joint, the gear is an axis of the child.
void along_one_axis(const double (&gear)[6], Actuator& actuator) {
  const auto used = std::count_if(gear, gear + 3, [](double part) { return part != 0.0; });
  if (used > 1) actuator.lost = "acts on a ball joint";  // the gear follows
  for (int k = 0; used == 1 && k < 3; ++k)
    if (gear[k] != 0.0) actuator.joint += k, actuator.gear = gear[k];
}

// The range of its control: its own, or a share of that of what it acts on, about the middle.
std::optional<Range> control_of(const Element& element, const Scene& scene, const Actuator& actuator) {
  const bool autolimits = scene.settings.of(element).autolimits;
  const double share = element.tag() == "position" ? element.number("inheritrange", 0.0) : 0.0;
  if (!(share > 0.0)) return limited_range(element, "ctrlrange", "ctrllimited", autolimits);
  if (element.has("ctrlrange")) element.fail("has ctrlrange and inheritrange", "keep one of them");
  enum { no, yes, automatic };
  const int mode = element.word("ctrllimited", {"false", "true", "auto"}, automatic);
  if (mode == automatic && !autolimits)
    element.fail("has inheritrange, but not ctrllimited, with autolimits=\"false\"",
                 "write ctrllimited=\"true\" or \"false\"");
  if (!actuator.lost.empty()) return std::nullopt;
  std::optional<Range> range;
  if (actuator.tendon >= 0)
    range = scene.tendons[static_cast<std::size_t>(actuator.tendon)].range;
  else if (const JointPart& joint = scene.joint(actuator.joint); joint.lower > -infinity)
    range = Range{joint.lower, joint.upper};
  if (!range) element.fail("inherits a range, but what it acts on has none", "give ctrlrange");
  const double middle = 0.5 * (range->lower + range->upper), half = 0.5 * share * (range->upper - range->lower);
  if (mode == no) return std::nullopt;
  return Range{middle - half, middle + half};
}

void read_actuator(const Element::Xml& xml, Scene& scene) {
  Numbers numbers;
  for (const Element::Xml* layer : scene.classes.defaults(xml, "", tags))
    write(Element(scene.document, *layer), numbers);
  write(Element(scene.document, xml), numbers);
  Element element(scene.document, xml, scene.classes.defaults(xml, "", tags));
  Actuator actuator;
  actuator.name = element.name("name", fmt::format("#{}", scene.actuators.size()));
  element.rename("actuator '" + actuator.name + "'");
  actuator.lost = obstacle(element.tag(), numbers);
  read_target(element, scene, actuator);
  double gear[6] = {1.0};
  element.numbers("gear", gear, 1, 6);
  actuator.gear = gear[0];
  if (actuator.lost.empty() && actuator.joint >= 0 && scene.joint(actuator.joint).type == JointType::ball)
    along_one_axis(gear, actuator);
  if (!actuator.lost.empty() && std::any_of(gear + 1, gear + 6, [](double part) { return part != 0.0; })) {
    actuator.lost += fmt::format(" along {:g}", fmt::join(gear, " "));
    actuator.gear = 1.0;
  }
  actuator.integrates = numbers.dynamics == Dynamics::integrator;
  if (numbers.dynamics == Dynamics::filter || numbers.dynamics == Dynamics::filterexact)
    actuator.lag = std::max(numbers.dynamic[0], 0.0);
  actuator.delay = element.number("delay", 0.0);
  if (actuator.delay < 0.0) element.fail("has a negative delay", "give 0 or more");
  actuator.samples = element.number("nsample", infinity);
  if (limited_range(element, "actrange", "actlimited", scene.settings.of(element).autolimits) &&
      numbers.dynamics != Dynamics::none)
    element.report().warn("ranges of the activation of actuators, left out", element.title());
  actuator.gain = numbers.gain[0];
  if (numbers.bias_type == Bias::none && element.has("biasprm") && !element.has("biastype"))
    element.report().warn("biasprm of actuators without a biastype, without effect", element.title());
  if (numbers.bias_type == Bias::affine) std::copy_n(numbers.bias, 3, actuator.bias);
  if (actuator.bias[2] > 0.0 && actuator.bias[1] == -actuator.gain) {
    actuator.has_damping_ratio = true;
    actuator.damping_ratio = std::exchange(actuator.bias[2], 0.0);
  }
  actuator.force = limited_range(element, "forcerange", "forcelimited", scene.settings.of(element).autolimits);
  actuator.control = control_of(element, scene, actuator);
  if (actuator.gear == 0.0 && actuator.lost.empty()) actuator.lost = "has a gear of 0";
  const int group = element.whole("group", 0);
  if (actuator.lost.empty() && group >= 0 && group < 31 && (scene.settings.disabled_groups >> group & 1u))
    actuator.lost = fmt::format("is of group {}, which actuatorgroupdisable switches off", group);
  scene.actuators.push_back(std::move(actuator));
}

}  // namespace

void read_actuators(Scene& scene) {
  for (const Element::Xml* xml : scene.section("actuator")) {
    const std::string_view tag = xml->Name();
    if (std::find(tags.begin(), tags.end(), tag) != tags.end()) {
      scene.report().attempt([&] { read_actuator(*xml, scene); });
    } else if (tag == "plugin" || tag == "dcmotor" || tag == "pid") {
      const Element lost(scene.document, *xml);
      Actuator actuator;
      actuator.name = lost.name("name", fmt::format("#{}", scene.actuators.size()));
      actuator.lost = fmt::format("is a {}", tag);
      scene.actuators.push_back(actuator);
    }
  }
}

}  // namespace lockstep::importer::mjcf
