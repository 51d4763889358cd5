// Pairs of colliders: which velocities move them against each other, and how far they yield. SPDX-License-Identifier:
// Apache-2.0
#include <algorithm>
#include <cmath>

#include "model/by_name.h"
#include "model/hull.h"
#include "plan/layout.h"
#include "plan/limits.h"

namespace lockstep {
namespace {

constexpr double hard_compliance = 1e-3;  // (M104), of the response
constexpr double most_apart = 1e-3;       // m, (M156)
constexpr double bottomless = 1e9;        // m
constexpr double slack_share = 2e-4;      // of the smaller one's reach: section 23

PairKind kind_of_pair(ShapeKind first, ShapeKind second) {
  using enum ShapeKind;
  if (first == height_field) return PairKind::height_field;
  struct Own {
    ShapeKind first, second;
    PairKind kind;
  };
  constexpr Own own[] = {{half_space, box, PairKind::half_space_box},
                         {half_space, hull, PairKind::half_space_hull},
                         {half_space, cylinder, PairKind::half_space_cylinder},
                         {half_space, capsule, PairKind::half_space_capsule},
                         {half_space, ellipsoid, PairKind::half_space_ellipsoid},
                         {half_space, sphere, PairKind::half_space_sphere},
                         {box, box, PairKind::box_box},
                         {box, capsule, PairKind::box_capsule},
                         {box, sphere, PairKind::box_sphere},
                         {capsule, capsule, PairKind::capsule_capsule},
                         {capsule, sphere, PairKind::capsule_sphere},
                         {sphere, sphere, PairKind::sphere_sphere}};
  for (const Own& pair : own)
    if (pair.first == first && pair.second == second) return pair.kind;
  if (first == ellipsoid || second >= ellipsoid) return PairKind::convex_point;
  return second == capsule ? PairKind::convex_line : PairKind::convex_faces;
}

// Of a ball about the origin that the collider holds.
double inner_radius(const ColliderPlace<double>& collider, const ContactTables<double>& t) {
  switch (collider.kind) {
    case ShapeKind::hull: {
      const HullTable<double> hull = hull_of(t, collider.table);
      double least = infinity;
      for (int face = 0; face < hull.faces; ++face) {
        const int corner = static_cast<int>(hull.face_corner[0][face]);
        double distance = 0.0;
        for (int k = 0; k < 3; ++k) distance += hull.normal[k][face] * hull.corner[k][corner];
        least = std::min(least, distance);
      }
      return collider.size[0] + least;
    }
    case ShapeKind::box:
    case ShapeKind::ellipsoid: return std::min({collider.size[0], collider.size[1], collider.size[2]});
    case ShapeKind::cylinder: return std::min(collider.size[0], collider.size[1]);
    case ShapeKind::half_space:
    case ShapeKind::height_field: return bottomless;
    default: return collider.size[0];
  }
}

// Leaves out the corners that take the least from the face's area: the support still knows them.
std::vector<int> most_corners(const Hull& hull, const HullFace& face) {
  std::vector<int> corners = face.corners;
  const auto at = [&](std::size_t i) { return hull.corners.col(corners[i % corners.size()]); };
  while (corners.size() > most_face_corners) {
    std::size_t least = 0;
    double area = infinity;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Eigen::Vector3d before = at(i + corners.size() - 1), own = at(i), after = at(i + 1);
      const double taken = (own - before).cross(after - before).norm();
      if (taken < area) area = taken, least = i;
    }
    corners.erase(corners.begin() + static_cast<std::ptrdiff_t>(least));
  }
  return corners;
}

// The collider's frame goes to the middle of the hull: GJK needs the origin inside.
void put_hull(const Shape& shape, ColliderPlace<double>& collider, std::vector<HullStructure>& hulls,
              std::vector<double>& numbers) {
  const Hull hull = hull_of(shape.points);
  const Eigen::Vector3d middle = solid_of(hull).center;
  const Eigen::Matrix3Xd corners = hull.corners.colwise() - middle;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) collider.offset[i] += collider.rotation[3 * i + j] * middle[j];
  collider.size[0] = shape.size[0];
  collider.reach = corners.colwise().norm().maxCoeff() + shape.size[0];
  for (int k = 0; k < 3; ++k) collider.half[k] = corners.row(k).cwiseAbs().maxCoeff() + shape.size[0];
  collider.table = static_cast<int>(hulls.size());

  std::vector<std::vector<int>> faces;
  std::size_t most = 0;
  for (const HullFace& face : hull.faces) {
    faces.push_back(most_corners(hull, face));
    most = std::max(most, faces.back().size());
  }
  hulls.push_back({static_cast<int>(corners.cols()), static_cast<int>(faces.size()), static_cast<int>(most),
                   static_cast<int>(numbers.size())});
  for (int k = 0; k < 3; ++k)
    for (Eigen::Index c = 0; c < corners.cols(); ++c) numbers.push_back(corners(k, c));
  for (int k = 0; k < 3; ++k)
    for (const HullFace& face : hull.faces) numbers.push_back(face.normal[k]);
  for (std::size_t c = 0; c < most; ++c)
    for (const std::vector<int>& face : faces) numbers.push_back(face[std::min(c, face.size() - 1)]);
}

// The largest number within `reach` columns and rows of each.
Eigen::MatrixXd largest_within(const Eigen::MatrixXd& numbers, const int (&reach)[2]) {
  Eigen::MatrixXd largest = numbers;
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::MatrixXd before = largest;
    const Eigen::Index count = axis == 0 ? before.cols() : before.rows();
    const auto line = [&](auto& matrix, Eigen::Index i) {
      return axis == 0 ? Eigen::MatrixXd(matrix.col(i)) : Eigen::MatrixXd(matrix.row(i));
    };
    for (Eigen::Index i = 0; i < count; ++i) {
      Eigen::MatrixXd most = line(before, i);
      for (Eigen::Index j = std::max<Eigen::Index>(0, i - reach[axis]); j < std::min(count, i + reach[axis] + 1); ++j)
        most = most.cwiseMax(line(before, j));
      if (axis == 0) largest.col(i) = most;
      if (axis == 1) largest.row(i) = most;
    }
  }
  return largest;
}

// `reach`: of the largest collider that may touch it.
void put_heights(const Shape& shape, double reach, ColliderPlace<double>& collider,
                 std::vector<HeightStructure>& fields, std::vector<double>& numbers) {
  const Eigen::MatrixXd& heights = shape.heights;
  const Eigen::Index cells[2] = {heights.cols() - 1, heights.rows() - 1};
  int around[2];
  for (int k = 0; k < 2; ++k) {
    collider.size[k] = static_cast<double>(cells[k]) / shape.size[k];
    around[k] = static_cast<int>(std::min(std::ceil(reach * collider.size[k]) + 2.0, static_cast<double>(cells[k])));
  }
  collider.size[2] = heights.maxCoeff();
  collider.table = static_cast<int>(fields.size());
  fields.push_back(
      {static_cast<int>(heights.cols()), static_cast<int>(heights.rows()), static_cast<int>(numbers.size())});
  const Eigen::MatrixXd most = largest_within(heights, around);
  for (const Eigen::MatrixXd* matrix : {&heights, &most})
    for (Eigen::Index row = 0; row < matrix->rows(); ++row)
      for (Eigen::Index column = 0; column < matrix->cols(); ++column) numbers.push_back((*matrix)(row, column));
}

// By collider: its own, or its link's.
std::vector<BodyPlace> places_of_colliders(const Program& program, bool of_links = false) {
  const ByName links(program.model.links);
  std::vector<BodyPlace> places;
  for (const Collider& collider : program.model.colliders)
    places.push_back(place_of(program, links.find(collider.link),
                              of_links ? Eigen::Isometry3d::Identity() : Eigen::Isometry3d(collider.pose)));
  return places;
}

// Of a box around a shape that is round about z.
void put_half(double radius, double half_length, ColliderPlace<double>& collider) {
  collider.half[0] = collider.half[1] = radius, collider.half[2] = half_length;
}

ColliderPlace<double> placed(const Collider& collider, const BodyPlace& place) {
  ColliderPlace<double> result{};
  result.body = place.body;
  result.kind = collider.shape.kind;
  result.scanned = result.body < 0 && (is_ground(result.kind) || result.kind == ShapeKind::box);
  put_pose(place.pose, result.rotation, result.offset);
  const Eigen::Vector3d& size = collider.shape.size;
  switch (collider.shape.kind) {
    case ShapeKind::half_space:
    case ShapeKind::height_field: break;  // by put_heights()
    case ShapeKind::box:
      for (int k = 0; k < 3; ++k) result.size[k] = result.half[k] = 0.5 * size[k];
      result.reach = 0.5 * size.norm();
      break;
    case ShapeKind::ellipsoid:
      for (int k = 0; k < 3; ++k) result.size[k] = result.half[k] = size[k];
      result.reach = size.maxCoeff();
      break;
    case ShapeKind::cylinder:
      result.size[0] = size[0], result.size[1] = 0.5 * size[1];
      result.reach = std::hypot(size[0], 0.5 * size[1]);
      put_half(size[0], 0.5 * size[1], result);
      break;
    case ShapeKind::hull: break;  // by put_hull()
    case ShapeKind::capsule:
      result.size[0] = size[0], result.size[1] = 0.5 * size[1];
      result.reach = size[0] + 0.5 * size[1];
      put_half(size[0], result.reach, result);
      break;
    case ShapeKind::sphere:
      result.size[0] = result.reach = size[0];
      put_half(size[0], size[0], result);
      break;
  }
  return result;
}

}  // namespace

std::vector<std::vector<int>> contact_velocities(const Program& program) {
  const std::vector<BodyPlace> places = places_of_colliders(program);
  const Forms forms(program, program.f64.reduction);
  std::vector<std::vector<int>> all;
  long entries = 0;
  for (const ColliderPair& pair : program.contacts.pairs) {
    all.emplace_back();
    for (const auto& [z, parts] : columns_between(program, forms, places[static_cast<std::size_t>(pair.first)].body,
                                                  places[static_cast<std::size_t>(pair.second)].body))
      all.back().push_back(z);
    entries += pair_count(all.back().size());
    require_room(program, entries, "the matrix of what its contacts move");
  }
  return all;
}

void lay_out_contacts(Program& program) {
  Tables<double>& t = program.f64;
  if (program.contacts.pairs.empty() || !t.rounds.used()) return;  // smooth integrators refuse them later
  std::vector<ColliderPlace<double>> colliders;
  std::vector<HullStructure> hulls;
  std::vector<HeightStructure> fields;
  std::vector<double> numbers;
  const std::vector<BodyPlace> places = places_of_colliders(program), links = places_of_colliders(program, true);
  for (const Collider& collider : program.model.colliders) {
    const std::size_t c = colliders.size();
    const bool in_link = t.declares(Parameter::collider_place) && !links[c].pose.matrix().isIdentity(0.0);
    colliders.push_back(
        placed(collider, in_link ? BodyPlace{links[c].body, Eigen::Isometry3d(collider.pose)} : places[c]));
    colliders.back().in_link = in_link;
    if (in_link) put_pose(links[c].pose, colliders.back().link_rotation, colliders.back().link_offset);
    if (collider.shape.kind == ShapeKind::hull) put_hull(collider.shape, colliders.back(), hulls, numbers);
  }
  for (std::size_t c = 0; c < colliders.size(); ++c) {
    if (colliders[c].kind != ShapeKind::height_field) continue;
    double reach = 0.0;
    for (const ColliderPair& pair : program.contacts.pairs)
      if (pair.first == static_cast<int>(c))
        reach = std::max(reach, colliders[static_cast<std::size_t>(pair.second)].reach);
    if (t.declares(Parameter::collider_size)) reach *= most_growth;
    put_heights(program.model.colliders[c].shape, reach, colliders[c], fields, numbers);
  }
  t.contacts.hulls = program.storage.keep(std::move(hulls));
  t.contacts.height_fields = program.storage.keep(std::move(fields));
  t.contacts.shape_numbers = program.storage.keep(std::move(numbers));
  std::vector<TouchingPair<double>> pairs;
  std::vector<PairColumn> columns;
  std::vector<ColumnPart> parts;
  std::vector<int> entries;
  std::vector<PairRange> contacts;
  int slots = 0;
  const Forms forms(program, t.reduction);
  for (const ColliderPair& from : program.contacts.pairs) {
    // Shapes, and the slots that they need.
    TouchingPair<double> pair{};
    pair.first = from.first, pair.second = from.second;
    pair.kind = kind_of_pair(program.model.colliders[static_cast<std::size_t>(from.first)].shape.kind,
                             program.model.colliders[static_cast<std::size_t>(from.second)].shape.kind);
    pair.slot = slots, pair.slots = slots_of(pair.kind);
    const ColliderPlace<double>&one = colliders[static_cast<std::size_t>(pair.first)],
          &other = colliders[static_cast<std::size_t>(pair.second)];
    pair.slack = slack_share * (is_ground(one.kind) ? other.reach : std::min(one.reach, other.reach));
    pair.by_boxes = is_convex(pair.kind) || pair.kind == PairKind::box_box || pair.kind == PairKind::box_capsule;
    const double inner = inner_radius(one, t.contacts), other_inner = inner_radius(other, t.contacts);
    pair.memory = is_convex(pair.kind) ? t.contacts.convex++ : -1;
    pair.size = one.reach + other.reach;
    pair.apart = std::min({most_apart, 0.1 * inner, 0.1 * other_inner});
    // Sizes of environments may be smaller than the model's.
    pair.middle = (inner + other_inner) / (t.declares(Parameter::collider_size) ? most_growth : 1.0);

    // The columns of its velocities (M108), and the entries of the matrix between them.
    pair.column = static_cast<int>(columns.size()), pair.entry = static_cast<int>(entries.size());
    for (const auto& [solver, list] : columns_between(program, forms, one.body, other.body)) {
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
    const double friction = from.friction > 0.0 ? from.friction : 1.0;
    pair.torsion_radius = from.torsional_friction / friction, pair.rolling_radius = from.rolling_friction / friction;
    const bool resists_turning = from.torsional_friction > 0.0 || from.rolling_friction > 0.0;
    pair.turns = pair.slots > 1 || resists_turning;
    pair.bounces = from.restitution > 0.0 || t.declares(Parameter::contact_restitution);
    t.contacts.bounces = t.contacts.bounces || pair.bounces;
    const RowSoftness<double> softness = row_softness(program, from.softness, program.settings.dt, 1);
    pair.rate = softness.rate, pair.cfm = softness.cfm, pair.soft = !is_hard(from.softness);
    pair.cfm_per_response = is_hard(from.softness) ? hard_compliance : softness.cfm_per_response;

    // A pair for each of its points, with columns of its own: each has another frame.
    const int points = points_of(pair.kind, other.kind), first_slot = pair.slot;
    pair.contact = static_cast<int>(contacts.size());
    contacts.push_back({static_cast<int>(pairs.size()), static_cast<int>(pairs.size()) + points});
    for (pair.point = 0; pair.point < points; ++pair.point) {
      pair.slot = slots, slots += pair.slots;
      pair.turning_friction = resists_turning ? t.contacts.turning_frictions : -1;
      t.contacts.turning_frictions += resists_turning ? pair.slots : 0;
      pairs.push_back(pair);
      pair.column = static_cast<int>(columns.size());
      for (int k = 0; k < pair.columns && pair.point + 1 < points; ++k)
        columns.push_back(columns[static_cast<std::size_t>(pairs.back().column + k)]);
    }

    // The contact as users named it.
    const int named_first = from.swapped ? from.second : from.first,
              named_second = from.swapped ? from.first : from.second;
    program.plan_contacts.push_back({pair_name(program.model, from), named_first, named_second, first_slot,
                                     slots - first_slot, from.friction, from.restitution, from.torsional_friction,
                                     from.rolling_friction});
  }

  t.contacts.slots = slots;
  t.contacts.contacts = program.storage.keep(std::move(contacts));
  t.contacts.colliders = program.storage.keep(std::move(colliders));
  t.contacts.pairs = program.storage.keep(std::move(pairs));
  t.contacts.columns = program.storage.keep(std::move(columns));
  t.contacts.parts = program.storage.keep(std::move(parts));
  t.contacts.entries = program.storage.keep(std::move(entries));
}

}  // namespace lockstep
