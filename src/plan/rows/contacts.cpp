// Pairs of colliders: which velocities move them against each other, and how far they yield. SPDX-License-Identifier:
// Apache-2.0
#include "plan/layout.h"

namespace lockstep {
namespace {

constexpr double hard_compliance = 1e-3;  // (M104), of the response

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

BodyPlace place_of(const Program& program, const Collider& collider) {
  return place_of(program, collider.link, Eigen::Isometry3d(collider.pose));
}

ColliderPlace<double> placed(const Program& program, const Collider& collider) {
  const BodyPlace place = place_of(program, collider);
  ColliderPlace<double> result{};
  result.body = place.body;
  put_pose(place.pose, result.rotation, result.offset);
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

MovingColumns columns_of(const Program& program, const ColliderPair& pair) {
  const auto body = [&](int collider) {
    return place_of(program, program.model.colliders[static_cast<std::size_t>(collider)]).body;
  };
  return columns_between(program, body(pair.first), body(pair.second));
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
