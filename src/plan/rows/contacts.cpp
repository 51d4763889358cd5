// Pairs of colliders: which velocities move them against each other, and how far they yield. SPDX-License-Identifier:
// Apache-2.0
#include <algorithm>
#include <map>
#include <set>

#include "plan/layout.h"

namespace lockstep {
namespace {

constexpr double hard_compliance = 1e-3;  // (M104), of the response

// A joint's velocity, or one of a floating root's six, that moves one collider of a pair and not the other.
struct MovingVelocity {
  int velocity, body, component;  // component: -1 for a joint
  int sign;
};

// The collider's frame in its body's, or in the world.
struct PlacedCollider {
  int body;
  Eigen::Isometry3d pose;
};

PlacedCollider place_of(const Program& program, const Collider& collider) {
  const Tables<double>& t = program.f64;
  const Eigen::Isometry3d own(collider.pose);
  if (collider.link.empty()) return {-1, own};
  const auto pose_of = [](const double(&rotation)[9], const double(&offset)[3]) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    for (int k = 0; k < 9; ++k) pose.matrix()(k / 3, k % 3) = rotation[k];
    for (int k = 0; k < 3; ++k) pose.matrix()(k, 3) = offset[k];
    return pose;
  };
  const LinkPlace<double>& link = t.link[program.model.link_index(collider.link)];
  const Eigen::Isometry3d in_body = pose_of(link.rotation, link.offset) * own;
  if (link.body >= 0) return {link.body, in_body};
  const TreePlace<double>& tree = t.tree[link.tree];
  return {-1, pose_of(tree.rotation, tree.offset) * in_body};
}

std::vector<MovingVelocity> chain_of(const Tables<double>& t, int body, int sign) {
  std::vector<MovingVelocity> chain;
  for (; body >= 0; body = t.body[body].parent) {
    const int first = t.body[body].velocity;
    for (int c = 0; t.body[body].root && c < 6; ++c) chain.push_back({first + c, body, c, sign});
    if (!t.body[body].root) chain.push_back({first, body, -1, sign});
  }
  return chain;
}

// What moves one of two bodies and not the other.
std::vector<MovingVelocity> moving(const Tables<double>& t, int first, int second) {
  std::map<int, MovingVelocity> all;
  for (const MovingVelocity& m : chain_of(t, second, 1)) all.emplace(m.velocity, m);
  for (const MovingVelocity& m : chain_of(t, first, -1))
    if (!all.emplace(m.velocity, m).second) all.erase(m.velocity);
  std::vector<MovingVelocity> list;
  for (const auto& [velocity, m] : all) list.push_back(m);
  return list;
}

int body_of(const Program& program, int collider) {
  return place_of(program, program.model.colliders[static_cast<std::size_t>(collider)]).body;
}

// By solver velocity: what it turns or moves of a pair.
std::map<int, std::vector<ColumnPart>> columns_of(const Program& program, const ColliderPair& pair) {
  const Tables<double>& t = program.f64;
  std::map<int, std::vector<ColumnPart>> columns;
  for (const MovingVelocity& m : moving(t, body_of(program, pair.first), body_of(program, pair.second))) {
    if (m.component >= 0) {
      for (int z = 0; z < t.solver.n; ++z)
        if (t.reduction.velocity_of(z) == m.velocity) columns[z].push_back({m.body, m.component, -1, m.sign});
      continue;
    }
    RowForm form{-1, Hard{}};
    add_joint(t, t.reduction, t.body[m.body].joint, -1, form);
    for (const auto& [z, contributions] : form.terms)
      for (const Contribution& c : contributions) columns[z].push_back({m.body, -1, c.value, m.sign});
  }
  return columns;
}

PairKind kind_of_pair(ShapeKind first, ShapeKind second) {
  if (first == ShapeKind::half_space)
    return second == ShapeKind::box       ? PairKind::half_space_box
           : second == ShapeKind::capsule ? PairKind::half_space_capsule
                                          : PairKind::half_space_sphere;
  if (first == ShapeKind::box)
    return second == ShapeKind::box       ? PairKind::box_box
           : second == ShapeKind::capsule ? PairKind::box_capsule
                                          : PairKind::box_sphere;
  if (first == ShapeKind::capsule)
    return second == ShapeKind::capsule ? PairKind::capsule_capsule : PairKind::capsule_sphere;
  return PairKind::sphere_sphere;
}

ColliderPlace<double> placed(const Program& program, const Collider& collider) {
  const PlacedCollider place = place_of(program, collider);
  ColliderPlace<double> result{};
  result.body = place.body;
  for (int k = 0; k < 9; ++k) result.rotation[k] = place.pose.linear()(k / 3, k % 3);
  for (int k = 0; k < 3; ++k) result.offset[k] = place.pose.translation()[k];
  const Eigen::Vector3d& size = collider.shape.size;
  switch (collider.shape.kind) {
    case ShapeKind::half_space: result.unlimited = true; break;
    case ShapeKind::box:
      for (int k = 0; k < 3; ++k) result.size[k] = 0.5 * size[k];
      result.reach = 0.5 * size.norm();
      break;
    case ShapeKind::capsule:
      result.size[0] = size[0], result.size[1] = 0.5 * size[1];
      result.reach = size[0] + 0.5 * size[1];
      break;
    case ShapeKind::sphere: result.size[0] = result.reach = size[0]; break;
  }
  return result;
}

}  // namespace

std::vector<std::vector<int>> contact_velocities(const Program& program) {
  std::vector<std::vector<int>> all;
  for (const ColliderPair& pair : program.contacts.pairs) {
    all.emplace_back();
    for (const auto& [z, parts] : columns_of(program, pair)) all.back().push_back(z);
  }
  return all;
}

void lay_out_contacts(Program& program) {
  Tables<double>& t = program.f64;
  if (program.contacts.pairs.empty() || !t.rounds.used()) return;  // smooth integrators refuse them later
  std::vector<ColliderPlace<double>> colliders;
  for (const Collider& collider : program.model.colliders) colliders.push_back(placed(program, collider));
  std::vector<TouchingPair<double>> pairs;
  std::vector<PairColumn> columns;
  std::vector<ColumnPart> parts;
  std::vector<int> entries;
  int slots = 0;
  for (const ColliderPair& from : program.contacts.pairs) {
    // Shapes, and the slots that they need.
    TouchingPair<double> pair{};
    pair.first = from.first, pair.second = from.second;
    pair.kind = kind_of_pair(program.model.colliders[static_cast<std::size_t>(from.first)].shape.kind,
                             program.model.colliders[static_cast<std::size_t>(from.second)].shape.kind);
    pair.slot = slots, pair.slots = slots_of(pair.kind);
    slots += pair.slots;

    // The columns of its velocities (M108), and the entries of the matrix between them.
    pair.column = static_cast<int>(columns.size()), pair.entry = static_cast<int>(entries.size());
    for (const auto& [solver, list] : columns_of(program, from)) {
      const int z = t.rounds.place[solver];
      const int first = static_cast<int>(parts.size());
      parts.insert(parts.end(), list.begin(), list.end());
      columns.push_back({z, first, static_cast<int>(parts.size())});
      for (int l = pair.column; l < static_cast<int>(columns.size()); ++l)
        entries.push_back(entry_of(t.rounds.columns, z, columns[static_cast<std::size_t>(l)].velocity));
    }
    pair.columns = static_cast<int>(columns.size()) - pair.column;

    // Friction, bounce, rate and compliance (M104).
    pair.friction = from.friction, pair.restitution = from.restitution;
    t.contacts.bounces = t.contacts.bounces || from.restitution > 0.0;
    const RowSoftness<double> softness = row_softness(program, from.softness, program.settings.dt, 1);
    pair.rate = softness.rate, pair.cfm = softness.cfm, pair.soft = !is_hard(from.softness);
    pair.cfm_per_response = is_hard(from.softness) ? hard_compliance : softness.cfm_per_response;
    pairs.push_back(pair);

    // The pair as users named it.
    const int named_first = from.swapped ? from.second : from.first,
              named_second = from.swapped ? from.first : from.second;
    program.plan_contacts.push_back({pair_name(program.model, from), named_first, named_second, pair.slot, pair.slots,
                                     from.friction, from.restitution});
  }

  t.contacts.slots = slots;
  t.contacts.colliders = program.storage.keep(std::move(colliders));
  t.contacts.pairs = program.storage.keep(std::move(pairs));
  t.contacts.columns = program.storage.keep(std::move(columns));
  t.contacts.parts = program.storage.keep(std::move(parts));
  t.contacts.entries = program.storage.keep(std::move(entries));
}

}  // namespace lockstep
