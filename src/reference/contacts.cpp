// SPDX-License-Identifier: Apache-2.0
#include "contacts.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace lockstep::reference {

using Eigen::Isometry3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

struct Solid {
  const Collider* collider;
  int link;  // -1: in the world
  Isometry3d pose;
};

struct Touch {
  Vector3d point, normal;
  double gap;
};

std::vector<Touch> on_plane(const Solid& plane, const Solid& body) {
  const Vector3d n = plane.pose.linear().col(2), size = body.collider->shape.size;
  std::vector<std::pair<Vector3d, double>> balls;  // centre, radius
  switch (body.collider->shape.kind) {
    case ShapeKind::sphere: balls = {{body.pose.translation(), size[0]}}; break;
    case ShapeKind::capsule:
      for (const double side : {-0.5, 0.5}) balls.push_back({body.pose * Vector3d(0, 0, side * size[1]), size[0]});
      break;
    case ShapeKind::box: {  // the lower face along the axis that is nearest to the normal
      Vector3d along = body.pose.linear().transpose() * n;
      int k = 0;
      along.cwiseAbs().maxCoeff(&k);
      for (const int i : {-1, 1})
        for (const int j : {-1, 1}) {
          Vector3d corner;
          corner[k] = along[k] > 0 ? -0.5 : 0.5, corner[(k + 1) % 3] = 0.5 * i, corner[(k + 2) % 3] = 0.5 * j;
          balls.push_back({body.pose * corner.cwiseProduct(size).eval(), 0.0});
        }
      break;
    }
    default: throw std::logic_error("two half-spaces");
  }
  std::vector<Touch> touches;
  for (const auto& [center, radius] : balls) {
    const double gap = n.dot(center - plane.pose.translation()) - radius;
    touches.push_back({center - n * (radius + 0.5 * gap), n, gap});
  }
  return touches;
}

std::vector<Touch> touches_of(const Solid& a, const Solid& b) {
  const ShapeKind first = a.collider->shape.kind, second = b.collider->shape.kind;
  if (first == ShapeKind::half_space) return on_plane(a, b);
  if (second != ShapeKind::sphere) throw std::logic_error("this pair of shapes has no reference");
  const Vector3d center = b.pose.translation();
  Vector3d nearest = a.pose.translation();
  double radius = 0.0;
  if (first == ShapeKind::sphere) {
    radius = a.collider->shape.size[0];
  } else if (first == ShapeKind::box) {
    const Vector3d half = 0.5 * a.collider->shape.size;
    nearest = a.pose * (a.pose.inverse() * center).cwiseMax(-half).cwiseMin(half).eval();
  } else {
    throw std::logic_error("this pair of shapes has no reference");
  }
  const Vector3d n = (center - nearest).normalized();
  const double gap = (center - nearest).norm() - radius - b.collider->shape.size[0];
  return {{nearest + n * (radius + 0.5 * gap), n, gap}};
}

// Velocities that hard couplings leave: v = S z, each follower being the coupling's first joint.
MatrixXd shares_of(const Stage& stage, const Mechanism& mechanism) {
  const int n = mechanism.velocities();
  std::vector<int> followers, others;
  for (const Coupling& coupling : mechanism.model().couplings)
    followers.push_back(mechanism.root_velocities() + mechanism.dof(coupling.joint));
  for (int i = 0; i < n; ++i)
    if (std::find(followers.begin(), followers.end(), i) == followers.end()) others.push_back(i);
  MatrixXd shares = MatrixXd::Zero(n, static_cast<Eigen::Index>(others.size()));
  for (std::size_t z = 0; z < others.size(); ++z) shares(others[z], static_cast<Eigen::Index>(z)) = 1.0;
  if (!followers.empty())
    shares(followers, Eigen::all) =
        -stage.jacobian(Eigen::all, followers).fullPivLu().solve(stage.jacobian(Eigen::all, others));
  return shares;
}

Vector3d projected(const Vector3d& y, double friction) {
  const double length = y.tail(2).norm();
  if (length <= friction * y[0]) return y;
  const double normal = (y[0] + friction * length) / (1.0 + friction * friction);
  if (normal <= 0.0) return Vector3d::Zero();
  Vector3d slides;
  slides << normal, friction * normal / length * y.tail(2);
  return slides;
}

// The impulses that minimise, by FISTA with restarts.
VectorXd cone_minimum(const MatrixXd& hessian, const VectorXd& linear, const std::vector<ContactPoint>& points) {
  const double step = 1.0 / hessian.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff();
  VectorXd x = VectorXd::Zero(linear.size()), ahead = x;
  double t = 1.0;
  for (int i = 0; i < 2000000; ++i) {
    const VectorXd y = ahead - step * (hessian * ahead + linear);
    VectorXd next(x.size());
    for (std::size_t c = 0; c < points.size(); ++c)
      next.segment<3>(3 * static_cast<Eigen::Index>(c)) =
          projected(y.segment<3>(3 * static_cast<Eigen::Index>(c)), points[c].friction);
    const double moved = (next - ahead).norm();
    if (moved <= 1e-15 * (1.0 + next.norm())) return next;
    if ((ahead - next).dot(next - x) > 0.0) t = 1.0;  // uphill
    const double after = 0.5 * (1.0 + std::sqrt(1.0 + 4.0 * t * t));
    ahead = next + (t - 1.0) / after * (next - x);
    x = next, t = after;
  }
  throw std::logic_error("the projected gradient has not converged");
}

}  // namespace

ContactStep contact_step(const Mechanism& mechanism, const StepSettings& settings, const State& state,
                         const Inputs& inputs, int passes) {
  const Model& model = mechanism.model();
  const Stage stage(mechanism, settings.dt, state, inputs);
  const MatrixXd shares = shares_of(stage, mechanism);
  const MatrixXd reduced = shares.transpose() * stage.implicit * shares;
  const std::vector<Isometry3d> links = mechanism.link_poses(state);
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
    for (const Touch& touch : touches_of(a, b)) {
      ContactPoint point;
      point.frame.row(0) = touch.normal;
      point.frame.row(1) = touch.normal.unitOrthogonal();
      point.frame.row(2) = touch.normal.cross(touch.normal.unitOrthogonal());
      MatrixXd jacobian = MatrixXd::Zero(3, mechanism.velocities());
      for (const auto& [side, sign] : {std::pair(&a, -1.0), std::pair(&b, 1.0)})
        if (side->link >= 0)
          jacobian +=
              sign * mechanism.jacobian(state, side->link, links[side->link].inverse() * touch.point).bottomRows(3);
      point.jacobian = point.frame * jacobian;
      const MatrixXd own = point.jacobian * shares;
      double response = 0.0;
      for (Eigen::Index z = 0; z < own.cols(); ++z) response += own.col(z).squaredNorm() / reduced(z, z) / 3.0;
      point.compliance = 1e-3 * response;
      point.gap = touch.gap;
      point.friction = std::sqrt(a.collider->friction * b.collider->friction);
      point.target = touch.gap > 0 ? touch.gap / settings.dt : std::max(0.2 / settings.dt * touch.gap, -3.0);
      result.points.push_back(point);
    }
  }
  const auto count = static_cast<Eigen::Index>(result.points.size());
  MatrixXd rows(3 * count, mechanism.velocities());
  for (Eigen::Index c = 0; c < count; ++c)
    rows.middleRows(3 * c, 3) = result.points[static_cast<std::size_t>(c)].jacobian;
  const MatrixXd inverse = shares * reduced.ldlt().solve(shares.transpose());
  const VectorXd free = inverse * (stage.implicit * stage.free);
  MatrixXd hessian = rows * inverse * rows.transpose();
  for (Eigen::Index c = 0; c < count; ++c)
    hessian.diagonal().segment<3>(3 * c).array() += result.points[static_cast<std::size_t>(c)].compliance;
  result.velocity = state.v;
  VectorXd impulses;
  for (int pass = 0; pass < passes; ++pass) {
    const VectorXd seen = rows * result.velocity;
    VectorXd linear = rows * free;
    for (Eigen::Index c = 0; c < count; ++c) {
      const ContactPoint& point = result.points[static_cast<std::size_t>(c)];
      linear[3 * c] += point.target + point.friction * seen.segment<2>(3 * c + 1).norm();
    }
    impulses = cone_minimum(hessian, linear, result.points);
    result.velocity = free + inverse * rows.transpose() * impulses;
  }
  for (Eigen::Index c = 0; c < count; ++c) result.impulses.push_back(impulses.segment<3>(3 * c));
  return result;
}

}  // namespace lockstep::reference
