// The tree of bodies, frames and replicates. SPDX-License-Identifier: Apache-2.0
#include "bodies.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "body_inertia.h"
#include "body_parts.h"
#include "lockstep/error.h"
#include "names.h"
#include "pose.h"

namespace lockstep::importer::mjcf {
namespace {

// No robot has more. The limit keeps replicates of replicates from filling the memory.
constexpr std::size_t most_copies = 20000;

// Where an element stands.
struct Around {
  std::size_t body = 0;
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();  // in the body
  std::string childclass = {};
  std::string suffix = {};  // that replicates give to names
};

class Reader {
 public:
  Reader(Document& document, const Settings& settings, const Classes& classes)
      : document_(document), settings_(settings), classes_(classes) {}

  Bodies read() {
    names_.take("world");
    bodies_.push_back({.name = "world", .place = document_.line(document_.root()) + ": <worldbody>"});
    bool is_there = false;
    for (const Element::Xml* xml : document_.children(document_.root())) {
      if (std::string_view(xml->Name()) != "worldbody") continue;
      is_there = true;
      const Element world(document_, *xml);
      read_children(world, {.childclass = classes_.childclass(world, "")});
    }
    if (!is_there)
      Element(document_, document_.root())
          .fail("has no <worldbody>", "give a whole model, or the file that includes it");
    name_unnamed();
    share_gravity();
    Bodies result{std::move(bodies_), {}};
    for (Body& body : result.all) {
      if (body.parent < 0) {
        result.moves.push_back(false);
        continue;
      }
      const auto parent = static_cast<std::size_t>(body.parent);
      result.moves.push_back(result.moves[parent] || !body.joints.empty());
      body.in_world = result.all[parent].in_world * body.pose;
    }
    return result;
  }

 private:
  // MuJoCo looks at the compensation of any body only where that of some body is above 0.
  void share_gravity() {
    if (std::ranges::any_of(bodies_, [](const Body& body) { return body.gravity < 1.0; })) return;
    for (Body& body : bodies_)
      if (std::exchange(body.gravity, 1.0) > 1.0)
        document_.report().remark("gravcomp below 0 with none above, which MuJoCo does not use", body.name);
  }

  void read_children(const Element& owner, const Around& around) {
    // In the order of the file: the joints of a frame move what the body's joints behind it carry.
    for (const Element::Xml* xml : owner.children()) document_.report().attempt([&] { read_child(*xml, around); });
  }

  void read_child(const Element::Xml& xml, const Around& around) {
    const std::string_view tag = xml.Name();
    if (tag == "body")
      read_body(xml, around);
    else if (tag == "frame")
      read_frame(xml, around);
    else if (tag == "replicate")
      read_replicate(xml, around);
    else if (tag == "attach")
      read_attached(xml, around);
    else
      read_part(xml, around);
  }

  void read_part(const Element::Xml& xml, const Around& around) {
    const std::string_view tag = xml.Name();
    const auto element = [&] { return classes_.element(xml, around.childclass); };
    Body& body = bodies_[around.body];
    if (tag == "joint" || tag == "freejoint") {
      read_joint(tag == "joint" ? element() : Element(document_, xml), around);
    } else if (tag == "inertial") {
      const Element inertial(document_, xml);
      if (around.body == 0) inertial.fail("is in the world, which has no mass", "remove it");
      if (body.has_inertial) inertial.fail("stands beside another <inertial> of the body", "keep one of them");
      body.inertia = read_inertial(inertial, settings_of(xml));
      body.has_inertial = true;
    } else if (tag == "geom") {
      GeomPart part = read_geom(element(), around.frame, around.suffix, settings_of(xml));
      if (!part.name.empty() && !geoms_.take(part.name))
        part.element.fail("has a name that is taken", "give each geom its own name");
      body.geoms.push_back(std::move(part));
    } else if (tag == "site") {
      const Element site = element();
      SitePart part = read_site(site, around.frame, settings_of(xml));
      if (site.has("name")) part.name = site.name("name") + around.suffix;
      if (!part.name.empty() && !sites_.take(part.name))
        site.fail(fmt::format("has the name '{}', which is taken", shortened(part.name)),
                  "give each site its own name");
      body.sites.push_back(std::move(part));
    } else if (tag == "composite" || tag == "flexcomp") {
      Element(document_, xml)
          .fail("makes bodies that only MuJoCo can make", "let MuJoCo save the model, and read that");
    } else if (tag == "plugin") {
      Element(document_, xml).report().warn("plugins, left out", Element(document_, xml).place());
    }
  }

  void read_joint(const Element& element, const Around& around) {
    Body& body = bodies_[around.body];
    if (around.body == 0) element.fail("is in the world, which does not move", "put it into a body");
    JointPart part = read_joint_part(element, around.frame, settings_.of(element));
    if (element.has("name")) part.name = element.name("name") + around.suffix;
    const bool frees = part.type == JointType::free;
    if (frees && body.parent != 0)
      element.fail("frees a body that another one carries", "let the body be a child of worldbody");
    if (!body.joints.empty() && (frees || body.floats()))
      element.fail("stands beside a free joint", "a free body has no other joints");
    if (part.type == JointType::ball)
      for (int k = 0; k < 3; ++k) body.joints.push_back(part_of(part, k));
    else
      body.joints.push_back(std::move(part));
  }

  // The first has the range of the angle.
  static JointPart part_of(const JointPart& ball, int k) {
    JointPart part = ball;
    part.ball = ball.name;
    part.axis = Eigen::Vector3d::Unit(k);
    if (!ball.name.empty()) part.name = name_of_part(ball.name, k);
    if (k > 0) part.upper = infinity;
    return part;
  }
  static std::string name_of_part(const std::string& ball, int k) { return ball + "." + "xyz"[k]; }

  void read_body(const Element::Xml& xml, const Around& around) {
    Element element(document_, xml);
    Body body;
    if (element.has("name")) {
      body.name = element.name("name") + around.suffix;
      element.rename("body '" + body.name + "'");
      if (!names_.take(body.name)) element.fail("has a name that is taken", "give each body its own name");
    }
    body.place = element.place();
    body.parent = static_cast<int>(around.body);
    body.part = document_.part_of(xml);
    const Eigen::Isometry3d own = read_pose(element, settings_.of(body.part));
    body.pose = around.frame * own, body.position = own.translation();
    body.is_mocap = element.truth("mocap", false);
    const double compensated = element.number("gravcomp", 0.0);
    if (settings_.has_springs || settings_.has_damping) body.gravity = 1.0 - compensated;
    bodies_.push_back(std::move(body));
    const std::size_t index = bodies_.size() - 1;
    read_children(
        element,
        {.body = index, .childclass = classes_.childclass(element, around.childclass), .suffix = around.suffix});
    const Body& read = bodies_[index];
    if (read.is_mocap && (read.parent != 0 || !read.joints.empty()))
      element.fail("is a mocap body with joints, or not a child of worldbody", "remove mocap, or the joints");
    if (settings_.of(read.part).inertia_from_geoms == FromGeoms::never && !read.has_inertial && !read.joints.empty())
      element.fail("has no <inertial>, which inertiafromgeom=\"false\" asks for", "add one");
  }

  void read_frame(const Element::Xml& xml, const Around& around) {
    const Element frame(document_, xml);
    Around inside = around;
    inside.frame = around.frame * read_pose(frame, settings_of(xml));
    inside.childclass = classes_.childclass(frame, around.childclass);
    read_children(frame, inside);
  }

  // A body of another model, or all of its world. What stands around the body there does not count.
  void read_attached(const Element::Xml& xml, const Around& around) {
    const Element attach(document_, xml);
    for (const char* attribute : {"model", "body", "prefix"}) attach.has(attribute);
    const Part& part = document_.attached_by(xml);
    if (part.body) return read_body(*part.body, {around.body, around.frame, part.childclass, around.suffix});
    for (const Element::Xml* section : document_.children(*part.root)) {
      if (std::string_view(section->Name()) != "worldbody") continue;
      const Element world(document_, *section);
      read_children(world, {around.body, around.frame, classes_.childclass(world, ""), around.suffix});
    }
  }

  void read_replicate(const Element::Xml& xml, const Around& around) {
    const Element replicate(document_, xml);
    const int count = replicate.whole("count", 0);
    if (!replicate.has("count") || count < 0) replicate.fail("has no count of 0 or more", "write count=\"...\"");
    for (const char* other : {"pos", "quat", "axisangle", "xyaxes", "zaxis"})
      if (replicate.has(other))
        document_.report().warn("places of replicates but offset and euler, without effect", replicate.place());
    const std::string separator = replicate.name("sep", "");
    const std::size_t digits = std::to_string(count).size();
    const Eigen::Vector3d offset = replicate.triple("offset", Eigen::Vector3d::Zero()),
                          euler = replicate.triple("euler", Eigen::Vector3d::Zero());
    Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
    const std::string childclass = classes_.childclass(replicate, around.childclass);
    for (int i = 0; i < count; ++i) {
      copies_ += 1 + replicate.children().size();
      if (copies_ > most_copies)
        replicate.fail(fmt::format("makes more than {} copies of elements", most_copies), "give a smaller count");
      std::string number = std::to_string(i);
      number.insert(0, digits - number.size(), '0');
      read_children(replicate, {around.body, around.frame * frame, childclass, separator + number + around.suffix});
      frame.translation() += frame.linear() * offset;
      frame.linear() = turn_by_euler((i + 1) * euler, settings_of(xml)).toRotationMatrix();
    }
  }

  // An unnamed joint is called after its body.
  void name_unnamed() {
    Names joints;
    const auto is_inner = [](const JointPart& joint) { return joint.type == JointType::ball && joint.part() > 0; };
    for (const Body& body : bodies_)
      for (const JointPart& joint : body.joints)
        if (!joint.name.empty() && !is_inner(joint) && !joints.take(joint.ball.empty() ? joint.name : joint.ball))
          throw_taken(joint);
    for (const Body& body : bodies_)
      for (const JointPart& joint : body.joints)
        if (!joint.name.empty() && !joint.ball.empty() && !joints.take(joint.name)) throw_taken(joint);
    for (Body& body : bodies_) {
      if (body.name.empty()) body.name = names_.unused("body");
      for (std::size_t j = 0; j < body.joints.size(); ++j) {
        JointPart& joint = body.joints[j];
        if (!joint.name.empty()) continue;
        if (joint.type != JointType::ball) {
          joint.name = joints.unused(body.name);
          continue;
        }
        joint.ball = joint.part() == 0 ? joints.unused(body.name) : body.joints[j - 1].ball;
        joint.name = joints.unused(name_of_part(joint.ball, joint.part()));
      }
    }
  }

  const Settings& settings_of(const Element::Xml& xml) const { return settings_.of(document_.part_of(xml)); }

  [[noreturn]] static void throw_taken(const JointPart& joint);

  Document& document_;
  const Settings& settings_;
  const Classes& classes_;
  std::vector<Body> bodies_;
  Names names_, geoms_, sites_;
  std::size_t copies_ = 0;
};

void Reader::throw_taken(const JointPart& joint) {
  throw ImportError(joint.place, "has a name that is taken", "give each joint its own name");
}

}  // namespace

Bodies read_bodies(Document& document, const Settings& settings, const Classes& classes) {
  return Reader(document, settings, classes).read();
}

}  // namespace lockstep::importer::mjcf
