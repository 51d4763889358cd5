// SPDX-License-Identifier: Apache-2.0
#include "contacts.h"

#include "bounds.h"
#include "integrators.h"
#include "servos.h"
#include "touches.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace lockstep::reference {

using Eigen::Isometry3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// Velocities that hard couplings without a force limit leave: v = S z, each follower being the coupling's first joint.
MatrixXd shares_of(const Stage& stage, const Mechanism& mechanism) {
  const int n = mechanism.velocities();
  std::vector<int> hard, followers, others;
  for (int c = 0; c < stage.couplings.count(); ++c) {
    if (!stage.rows[c].active || !stage.rows[c].hard || stage.rows[c].limited) continue;
    const int follower =
        mechanism.root_velocities() + mechanism.dof(mechanism.model().couplings[static_cast<std::size_t>(c)].joint);
    if (std::find(followers.begin(), followers.end(), follower) != followers.end())
      throw std::logic_error("two couplings have one first joint");
    hard.push_back(c);
    followers.push_back(follower);
  }
  for (int i = 0; i < n; ++i)
    if (std::find(followers.begin(), followers.end(), i) == followers.end()) others.push_back(i);
  MatrixXd shares = MatrixXd::Zero(n, static_cast<Eigen::Index>(others.size()));
  for (std::size_t z = 0; z < others.size(); ++z) shares(others[z], static_cast<Eigen::Index>(z)) = 1.0;
  if (!followers.empty())
    shares(followers, Eigen::all) = -stage.jacobian(hard, followers).fullPivLu().solve(stage.jacobian(hard, others));
  return shares;
}

VectorXd projected(const VectorXd& y, double friction) {
  const Eigen::Index others = y.size() - 1;
  const double length = y.tail(others).norm();
  if (length <= friction * y[0]) return y;
  const double normal = (y[0] + friction * length) / (1.0 + friction * friction);
  if (normal <= 0.0) return VectorXd::Zero(y.size());
  VectorXd slides(y.size());
  slides << normal, friction * normal / length * y.tail(others);
  return slides;
}

// With the normal impulse given, friction is in a disc.
VectorXd in_disc(const VectorXd& y, double normal, double friction) {
  const Eigen::Index others = y.size() - 1;
  const double length = y.tail(others).norm(), most = friction * normal;
  VectorXd found(y.size());
  found << normal, (length > most ? most / length : 1.0) * y.tail(others);
  return found;
}

// Where the rows of each point begin, and where those of all end.
std::vector<Eigen::Index> first_rows(const std::vector<ContactPoint>& points) {
  std::vector<Eigen::Index> first = {0};
  for (const ContactPoint& point : points) first.push_back(first.back() + point.jacobian.rows());
  return first;
}

// An impulse along a direction within an interval, and the speed that it answers to: a side of an interval of speeds,
// or a box of (M54).
struct Pull {
  VectorXd direction;
  double speed, compliance;
  double least, most;  // impulse
};

// Bounds, soft couplings and limited servos as pulls.
std::vector<Pull> pulls_of(const Mechanism& mechanism, const Stage& stage, const Inputs& inputs) {
  std::vector<Pull> pulls;
  const auto add = [&](const BoundedRow& row) {
    if (row.lo > -infinity) pulls.push_back({row.direction, row.lo, row.cfm, 0.0, infinity});
    if (row.hi < infinity) pulls.push_back({row.direction, row.hi, row.cfm, -infinity, 0.0});
    if (row.box > 0.0) pulls.push_back({row.direction, -row.bias, row.cfm, -row.box, row.box});
  };
  for (const BoundedRow& row : bounded_rows(mechanism, stage, inputs, {Phase::position, stage.state.q})) add(row);
  for (int c = 0; c < stage.couplings.count(); ++c) {
    const Row& row = stage.rows[c];
    if (row.active && !row.hard && !row.limited)
      pulls.push_back({stage.jacobian.row(c), -stage.correction[c], row.cfm, -infinity, infinity});
  }
  for (int dof = 0; dof < mechanism.dofs(); ++dof) {
    const Joint& joint = mechanism.joint(dof);
    if (!limited_servo(joint)) continue;
    const double kp = joint.drive.kp, kd = joint.drive.kd, h = stage.h, gain = h * (h * kp + kd);
    const double at_rest = inputs.efforts[dof] + kd * inputs.velocity_targets[dof] -
                           kp * (stage.state.q[dof] - inputs.position_targets[dof]);
    pulls.push_back({VectorXd::Unit(mechanism.velocities(), mechanism.root_velocities() + dof), h * at_rest / gain,
                     1.0 / gain, -h * joint.effort_limit, h * joint.effort_limit});
  }
  return pulls;
}

// The impulses that minimise, by FISTA with restarts: those of the points, then those of the pulls. Where `normal` is
// not below 0 it is given.
VectorXd cone_minimum(const MatrixXd& hessian, const VectorXd& linear, const std::vector<ContactPoint>& points,
                      const VectorXd& normal, const std::vector<Pull>& pulls) {
  const double step = 1.0 / hessian.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff();
  const std::vector<Eigen::Index> first = first_rows(points);
  VectorXd x = VectorXd::Zero(linear.size()), ahead = x;
  double t = 1.0;
  for (int i = 0; i < 2000000; ++i) {
    const VectorXd y = ahead - step * (hessian * ahead + linear);
    VectorXd next(x.size());
    for (std::size_t p = 0; p < points.size(); ++p) {
      const auto c = static_cast<Eigen::Index>(p);
      const VectorXd own = y.segment(first[p], first[p + 1] - first[p]);
      next.segment(first[p], own.size()) =
          normal[c] < 0.0 ? projected(own, points[p].friction) : in_disc(own, normal[c], points[p].friction);
    }
    for (std::size_t p = 0; p < pulls.size(); ++p) {
      const Eigen::Index i = first.back() + static_cast<Eigen::Index>(p);
      next[i] = std::clamp(y[i], pulls[p].least, pulls[p].most);
    }
    const double moved = (next - ahead).norm();
    if (moved <= 1e-15 * (1.0 + next.norm())) return next;
    if ((ahead - next).dot(next - x) > 0.0) t = 1.0;  // uphill
    const double after = 0.5 * (1.0 + std::sqrt(1.0 + 4.0 * t * t));
    ahead = next + (t - 1.0) / after * (next - x);
    x = next, t = after;
  }
  throw std::logic_error("the projected gradient has not converged");
}

// Compliance is a number in 1/kg, plus a share of a response in 1/kg; what an overlap asks for is rate * gap in m/s.
struct Yielding {
  double rate, compliance, share;
  bool soft;
};

Yielding yielding(const Softness& softness, double h) {
  if (const auto* spring = std::get_if<Spring>(&softness)) {
    const double damping = h * spring->kp + spring->kd;  // of a force -kp (x + h u) - kd u
    return {spring->kp / damping, 1.0 / (h * damping), 0.0, true};
  }
  if (const auto* vibration = std::get_if<Frequency>(&softness)) {  // the same with kp = w^2 m, kd = 2 zeta w m
    const double w = vibration->rad_per_s, damping = h * w * w + 2.0 * vibration->damping_ratio * w;
    return {w * w / damping, 0.0, 1.0 / (h * damping), true};
  }
  if (const auto* hard = std::get_if<Hard>(&softness)) return {hard->erp / h, 0.0, 1e-3, false};
  throw std::logic_error("this softness has no reference");
}

// The speed after an impact over the speed of the step without contacts. Velocities of the step are those of half a
// step before its end: u at the start is the speed at -h/2, and gravity's share of a half step is added twice.
double restored_share(double restitution, double h, double gap, double start, double free) {
  const double acceleration = (free - start) / h, now = start + 0.5 * h * acceleration;
  const double at_surface = std::sqrt(std::max(0.0, now * now - 2.0 * acceleration * gap));
  const double half_step = 0.5 * h * acceleration;
  if (restitution * at_surface <= std::abs(half_step)) return 0.0;
  return std::min(1.5, (restitution * at_surface - half_step) / std::abs(free));
}

// A rebound within a step whose velocities are those of its ends; the gap is that of the middle.
struct Rebound {
  bool lands = false, later = false;  // within this step, or in a later one
  double landing = 2.0;               // share of the step before it
  double share = 0.0;                 // of the speed without contacts that is left at the end, upwards
  double way = 0.0;                   // from this middle to the next one, over the step
};

Rebound rebound_within(double restitution, double h, double gap, double start, double end) {
  Rebound rebound;
  const double acceleration = (end - start) / h, height = std::max(0.0, gap - 0.5 * h * start);
  const double impact = std::sqrt(std::max(0.0, start * start - 2.0 * acceleration * height));
  if (restitution <= 0.0 || start >= -0.05 || restitution * impact <= -acceleration * h) return rebound;
  rebound.lands = gap + 0.5 * h * end < 0.0, rebound.later = !rebound.lands;
  if (rebound.later) return rebound;
  const double falls = std::min(h, 2.0 * height / (impact - start)), flies = h - falls;
  rebound.landing = falls / h;
  const double slows = std::min(0.0, acceleration), leaves = restitution * impact;
  const double height_after = leaves * flies + 0.5 * slows * flies * flies, speed_after = leaves + slows * flies;
  rebound.share = std::min(1.5, speed_after / std::abs(end));
  rebound.way = (height_after - gap) / h + 0.5 * speed_after;
  return rebound;
}

// The step from stage.state, by stage.implicit, stage.free and the pulls. `expected` is the velocity at its end without
// contacts. `in_middle`: stage.state is the middle of a step of leapfrog.
ContactStep solved(const Mechanism& mechanism, const Stage& stage, const std::vector<Pull>& pulls,
                   const VectorXd* expects, bool in_middle) {
  const Model& model = mechanism.model();
  const MatrixXd shares = shares_of(stage, mechanism);
  const MatrixXd reduced = shares.transpose() * stage.implicit * shares;
  const MatrixXd inverse = shares * reduced.ldlt().solve(shares.transpose());
  const VectorXd free = inverse * (stage.implicit * stage.free);  // the velocity without contacts
  const VectorXd& expected = expects ? *expects : free;
  const std::vector<Isometry3d> links = mechanism.link_poses(stage.state);
  const auto solid = [&](const std::string& name) {
    for (const Collider& collider : model.colliders)
      if (collider.name == name) {
        const int link = collider.link.empty() ? -1 : model.link_index(collider.link);
        return Solid{&collider, link, (link < 0 ? Isometry3d::Identity() : links[link]) * Isometry3d(collider.pose)};
      }
    throw std::logic_error("pairs are named collider by collider");
  };
  ContactStep result;
  for (const Contact& contact : model.contacts) {
    const Solid a = solid(contact.first), b = solid(contact.second);
    const Yielding yields = yielding(contact.softness.value_or(Hard{}), stage.h);
    const double restitution = contact.restitution.value_or(std::max(a.collider->restitution, b.collider->restitution));
    for (const Touch& touch : touches_of(a, b)) {
      ContactPoint point;
      point.frame.row(0) = touch.normal;
      point.frame.row(1) = touch.normal.unitOrthogonal();
      point.frame.row(2) = touch.normal.cross(touch.normal.unitOrthogonal());
      MatrixXd jacobian = MatrixXd::Zero(6, mechanism.velocities());
      for (const auto& [side, sign] : {std::pair(&a, -1.0), std::pair(&b, 1.0)})
        if (side->link >= 0)
          jacobian += sign * mechanism.jacobian(stage.state, side->link,
                                                links[side->link].inverse() *
                                                    (touch.point + 0.5 * sign * touch.gap * touch.normal).eval());
      point.friction = contact.friction.value_or(std::sqrt(a.collider->friction * b.collider->friction));
      const double torsion = contact.torsional_friction.value_or(
                       std::max(a.collider->torsional_friction, b.collider->torsional_friction)),
                   rolling = contact.rolling_friction.value_or(
                       std::max(a.collider->rolling_friction, b.collider->rolling_friction));
      const bool resists_turning = torsion > 0.0 || rolling > 0.0;
      point.jacobian.resize(resists_turning ? 6 : 3, mechanism.velocities());
      point.jacobian.topRows(3) = point.frame * jacobian.bottomRows(3);
      if (resists_turning)
        point.jacobian.bottomRows(3) =
            Vector3d(torsion, rolling, rolling).asDiagonal() * (point.frame * jacobian.topRows(3)) / point.friction;
      const MatrixXd own = point.jacobian.topRows(3) * shares;
      Vector3d response = Vector3d::Zero();  // of the three rows
      for (Eigen::Index z = 0; z < own.cols(); ++z) response += own.col(z).cwiseAbs2() / reduced(z, z);
      const double mean = response.sum() / 3.0;
      point.soft = yields.soft, point.gap = touch.gap;
      point.compliance = yields.compliance + yields.share * (yields.soft ? std::max(response[0], 0.01 * mean) : mean);
      const double start = point.jacobian.row(0).dot(stage.state.v), arrives = point.jacobian.row(0).dot(expected);
      Rebound rebound;
      if (in_middle) {
        rebound = rebound_within(restitution, stage.h, touch.gap, start, arrives);
        if (rebound.later) continue;
        point.bounces = rebound.lands, point.restored = rebound.share;
        if (point.bounces) point.compliance = std::min(point.compliance, 1e-5 * mean);
      } else {
        point.bounces = restitution > 0.0 && touch.gap + stage.h * arrives < 0.0 && start < -0.05;
        point.restored = point.bounces ? restored_share(restitution, stage.h, touch.gap, start, arrives) : 0.0;
        if (point.bounces) point.compliance = std::min(point.compliance, 1e-3 * mean);
      }
      point.along_surface = resists_turning ? std::min(point.compliance, 1e-3 * mean) : point.compliance;
      const double most = 3.0 * std::min(1.0, 3.0 * std::sqrt(response[0] / response.sum()));
      const double pushed = yields.rate * touch.gap;
      point.target = touch.gap > 0                   ? touch.gap / stage.h
                     : yields.soft && !point.bounces ? pushed
                                                     : std::max(pushed, -most);
      if (rebound.lands) point.target = -rebound.way;
      point.landing = rebound.landing;
      result.points.push_back(point);
    }
  }
  const auto count = static_cast<Eigen::Index>(result.points.size());
  const auto pulling = static_cast<Eigen::Index>(pulls.size());
  const std::vector<Eigen::Index> first = first_rows(result.points);
  const Eigen::Index contact_rows = first.back();
  const auto begin = [&](Eigen::Index c) { return first[static_cast<std::size_t>(c)]; };
  const auto size = [&](Eigen::Index c) { return begin(c + 1) - begin(c); };
  MatrixXd rows(contact_rows + pulling, mechanism.velocities());
  for (Eigen::Index c = 0; c < count; ++c)
    rows.middleRows(begin(c), size(c)) = result.points[static_cast<std::size_t>(c)].jacobian;
  for (Eigen::Index p = 0; p < pulling; ++p)
    rows.row(contact_rows + p) = pulls[static_cast<std::size_t>(p)].direction.transpose();
  MatrixXd hessian = rows * inverse * rows.transpose();
  for (Eigen::Index p = 0; p < pulling; ++p)
    hessian(contact_rows + p, contact_rows + p) += pulls[static_cast<std::size_t>(p)].compliance;
  for (Eigen::Index c = 0; c < count; ++c) {
    const ContactPoint& point = result.points[static_cast<std::size_t>(c)];
    hessian(begin(c), begin(c)) += point.compliance;
    hessian.diagonal().segment(begin(c) + 1, size(c) - 1).array() += point.along_surface;
  }
  const VectorXd seen = rows * stage.state.v, free_speed = rows * free;
  // The impulses that answer to targets, with some normal impulses given.
  const auto impulses_for = [&](const VectorXd& targets, const VectorXd& normal) {
    VectorXd linear = free_speed;
    for (Eigen::Index c = 0; c < count; ++c)
      linear[begin(c)] += targets[c] + result.points[static_cast<std::size_t>(c)].friction *
                                           seen.segment(begin(c) + 1, size(c) - 1).norm();
    for (Eigen::Index p = 0; p < pulling; ++p) linear[contact_rows + p] -= pulls[static_cast<std::size_t>(p)].speed;
    return cone_minimum(hessian, linear, result.points, normal, pulls);
  };
  VectorXd targets(count), normal = VectorXd::Constant(count, -1.0);
  for (Eigen::Index c = 0; c < count; ++c) targets[c] = result.points[static_cast<std::size_t>(c)].target;
  VectorXd impulses = impulses_for(targets, normal);
  for (Eigen::Index c = 0; c < count; ++c) result.impulses.push_back(impulses.segment(begin(c), size(c)));
  result.velocity = result.stays = free + inverse * rows.transpose() * impulses;

  // No speed of a push-out stays, and what bounces is stopped.
  bool again = false, restores = false;
  for (Eigen::Index c = 0; c < count; ++c) {
    const ContactPoint& point = result.points[static_cast<std::size_t>(c)];
    again = again || point.bounces || (!point.soft && targets[c] < -0.01 && impulses[begin(c)] > 0.0);
  }
  result.last = result.impulses;
  if (!again || pulling > 0) return result;
  for (Eigen::Index c = 0; c < count; ++c) {
    const ContactPoint& point = result.points[static_cast<std::size_t>(c)];
    if (point.bounces || (!point.soft && point.gap <= 0.0)) targets[c] = 0.0;
  }
  impulses = impulses_for(targets, normal);
  result.stays = free + inverse * rows.transpose() * impulses;
  const auto keep = [&] {
    for (Eigen::Index c = 0; c < count; ++c)
      result.last[static_cast<std::size_t>(c)] = impulses.segment(begin(c), size(c));
  };
  keep();

  // Poisson's restitution: what has stopped it comes back in part.
  const VectorXd stopped = rows * result.stays;
  for (Eigen::Index c = 0; c < count; ++c) {
    const ContactPoint& point = result.points[static_cast<std::size_t>(c)];
    if (!point.bounces) continue;
    const double arrives = std::max(std::abs(point.jacobian.row(0).dot(expected)), 1e-6),
                 left = arrives + std::min(stopped[begin(c)], 0.0);
    normal[c] = (1.0 + point.restored) * impulses[begin(c)] * arrives / std::max(left, arrives / 1.01);
    restores = restores || (point.restored > 0.0 && impulses[begin(c)] > 0.0);
  }
  if (!restores) return result;
  impulses = impulses_for(targets, normal);
  result.stays = free + inverse * rows.transpose() * impulses;
  keep();
  return result;
}

}  // namespace

ContactStep contact_step(const Mechanism& mechanism, const StepSettings& settings, const State& state,
                         const Inputs& inputs) {
  const std::vector<Servo> servos(static_cast<std::size_t>(mechanism.dofs()), Servo::apart);
  const Acting without_servos = acting(mechanism, inputs, servos);
  const Stage stage(without_servos.mechanism, settings.dt, state, without_servos.inputs);
  return solved(mechanism, stage, pulls_of(mechanism, stage, inputs), nullptr, false);
}

MiddleStep middle_step(const Mechanism& mechanism, const StepSettings& settings, const State& start,
                       const Inputs& inputs) {
  const double h = settings.dt;
  const int dofs = mechanism.dofs();
  State middle = mechanism.advanced(start, start.v, 0.5 * h);
  mechanism.turn_axes(start, middle);
  StepSettings smooth = settings;
  smooth.integrator = Integrator::leapfrog;
  const State end = integrated(mechanism, smooth, start, [&](double, Inputs& own) { own = inputs; });
  State expected = middle;
  expected.v = end.v;
  mechanism.turn_axes(end, expected);

  // Springs and dampers by the implicit midpoint rule, or where they are stiff by their force at the next middle.
  Stage stage(mechanism, h, middle, inputs);
  MatrixXd inertia = stage.mass;
  inertia.diagonal() += mechanism.armature();
  const MatrixXd shares = shares_of(stage, mechanism), reduced = shares.transpose() * inertia * shares;
  const VectorXd damping = mechanism.damping() + mechanism.kd(), stiffness = mechanism.kp() + mechanism.stiffness();
  State seen = middle;
  Inputs targets = inputs;
  stage.implicit = inertia;
  for (int dof = 0; dof < dofs; ++dof) {
    const int i = mechanism.root_velocities() + dof;
    double response = 0.0;
    for (Eigen::Index z = 0; z < shares.cols(); ++z) response += shares(i, z) * shares(i, z) / reduced(z, z);
    const bool stiff = !((h * damping[i] + h * h * stiffness[i]) * response < 16.0);
    const double part = stiff ? 1.0 : 0.5;
    stage.implicit(i, i) += part * h * damping[i] + part * part * h * h * stiffness[i];
    if (stiff) seen.q[dof] += h * middle.v[i];
    targets.position_targets[dof] += (stiff ? 0.5 : -0.5) * h * inputs.velocity_targets[dof];
  }
  const VectorXd forces = mechanism.joint_forces(seen, targets) - predicted_bias(mechanism, smooth, start, inputs);
  stage.free = middle.v + stage.implicit.ldlt().solve(h * forces);
  MiddleStep step{middle, solved(mechanism, stage, {}, &expected.v, true)};
  const ContactStep& contacts = step.contacts;
  step.presses = std::any_of(contacts.impulses.begin(), contacts.impulses.end(),
                             [](const VectorXd& impulse) { return impulse[0] > 0.0; });
  // Where all that presses bounces, the way before the first landing and the way after it.
  double landing = 2.0;
  bool others = false;
  for (std::size_t c = 0; c < contacts.points.size(); ++c) {
    if (contacts.last[c][0] <= 0.0) continue;
    landing = std::min(landing, contacts.points[c].landing), others = others || !contacts.points[c].bounces;
  }
  VectorXd way = contacts.velocity - 0.5 * (contacts.stays - middle.v);
  if (landing <= 1.0 && !others) {
    const VectorXd gain = 0.5 * (expected.v - middle.v);
    way = landing * (middle.v + landing * gain) + (1.0 - landing) * (contacts.stays - (1.0 - landing) * gain);
  }
  step.end = mechanism.advanced(middle, 2.0 * way - middle.v, 0.5 * h);
  step.end.v = contacts.stays;
  mechanism.turn_axes(middle, step.end);
  if (!step.presses) step.end = end;
  return step;
}

}  // namespace lockstep::reference
