// Bullet as a peer: a multibody and its gears per environment, servos as torques. SPDX-License-Identifier: Apache-2.0
//
// Bullet's motors have no stiffness and damping in physical units. So servos and joint damping are torques of the
// caller, and therefore explicit. Bullet's URDF importer leaves damping to the caller in the same way.
#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyGearConstraint.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <btBulletCollisionCommon.h>
#include <fmt/format.h>

#include <cmath>

#include "peer.h"

namespace lockstep::peers {
namespace {

btVector3 vector(const Eigen::Vector3d& v) { return {btScalar(v.x()), btScalar(v.y()), btScalar(v.z())}; }
btQuaternion turn_back(const Pose& pose) {
  const Eigen::Quaterniond q(pose.linear().transpose());
  return {btScalar(q.x()), btScalar(q.y()), btScalar(q.z()), btScalar(q.w())};
}

// What all environments share.
struct Shared {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btSphereShape shape{btScalar(0.01)};
};

// A link has the index of its joint; the base is -1.
class World {
 public:
  World(Shared& shared, const Model& model, int sweeps) : model_(model) {
    build_body();
    world_ =
        std::make_unique<btMultiBodyDynamicsWorld>(&shared.dispatcher, &broadphase_, &solver_, &shared.configuration);
    world_->setGravity(vector(model_.gravity));
    world_->getSolverInfo().m_numIterations = sweeps;
    world_->addMultiBody(body_.get());
    for (const Coupling& coupling : model_.couplings) add_gear(coupling, shared);
  }
  ~World() {
    for (auto& gear : gears_) world_->removeMultiBodyConstraint(gear.get());
    world_->removeMultiBody(body_.get());
    for (auto& collider : colliders_) world_->removeCollisionObject(collider.get());
  }

  void reset() {
    const Root root = root_of(model_);
    const Pose& pose = root.pose;
    const Eigen::Vector3d center = model_.links[0].inertia.center;
    const Eigen::Vector3d omega = root.velocity.head<3>(), origin = root.velocity.tail<3>();
    body_->setBasePos(vector(pose * center));
    body_->setWorldToBaseRot(turn_back(pose));
    body_->setBaseOmega(vector(pose.linear() * omega));
    body_->setBaseVel(vector(pose.linear() * (origin + omega.cross(center))));
    for (std::size_t j = 0; j < model_.joints.size(); ++j) {
      body_->setJointPos(static_cast<int>(j), btScalar(model_.joints[j].position));
      body_->setJointVel(static_cast<int>(j), btScalar(model_.joints[j].velocity));
    }
  }

  void step(const Eigen::VectorXd& targets, btScalar dt) {
    for (int j = 0; j < body_->getNumLinks(); ++j) {
      const Joint& joint = model_.joints[j];
      const double speed = body_->getJointVel(j), error = targets[j] - body_->getJointPos(j);
      const double torque = joint.drive.kp * error - (joint.drive.kd + joint.damping) * speed;
      body_->addJointTorque(j, btScalar(torque));
    }
    world_->stepSimulation(dt, 0);
  }

  double position(int joint) const { return body_->getJointPos(joint); }

 private:
  void build_body() {
    const Inertia& root = model_.links[0].inertia;
    body_ = std::make_unique<btMultiBody>(static_cast<int>(model_.joints.size()), btScalar(root.mass),
                                          vector(root.about_center.diagonal()), !root_of(model_).floating, false);
    for (std::size_t j = 0; j < model_.joints.size(); ++j) {
      const Joint& joint = model_.joints[j];
      const Inertia& inertia = model_.links[model_.link_index(joint.child)].inertia;
      const int parent = joint_of_link(model_, joint.parent);
      const Eigen::Vector3d parent_center = model_.links[model_.link_index(joint.parent)].inertia.center;
      body_->setupRevolute(static_cast<int>(j), btScalar(inertia.mass), vector(inertia.about_center.diagonal()), parent,
                           turn_back(joint.origin), vector(joint.axis.normalized()),
                           vector(joint.origin.translation() - parent_center), vector(inertia.center), true);
    }
    body_->setLinearDamping(0);
    body_->setAngularDamping(0);
    body_->setMaxCoordinateVelocity(btScalar(1e9));
    body_->finalizeMultiDof();
  }

  // Bullet solves a constraint with the island of its first link's collider, and does not solve it without a collider.
  // This collider collides with nothing: its group and mask are 0.
  void add_collider(int link, Shared& shared) {
    if (body_->getLink(link).m_collider) return;
    auto collider = std::make_unique<btMultiBodyLinkCollider>(body_.get(), link);
    collider->setCollisionShape(&shared.shape);
    world_->addCollisionObject(collider.get(), 0, 0);
    body_->getLink(link).m_collider = collider.get();
    colliders_.push_back(std::move(collider));
  }

  void add_gear(const Coupling& coupling, Shared& shared) {
    add_collider(model_.joint_index(coupling.joint), shared);
    const btVector3 zero(0, 0, 0);
    const btMatrix3x3 same = btMatrix3x3::getIdentity();
    auto gear = std::make_unique<btMultiBodyGearConstraint>(body_.get(), model_.joint_index(coupling.joint),
                                                            body_.get(), model_.joint_index(coupling.terms[0].joint),
                                                            zero, zero, same, same);
    gear->setGearRatio(btScalar(coupling.terms[0].ratio));
    gear->setRelativePositionTarget(btScalar(-coupling.offset));
    gear->setErp(1);
    gear->setMaxAppliedImpulse(btScalar(1e9));
    world_->addMultiBodyConstraint(gear.get());
    gears_.push_back(std::move(gear));
  }

  Model model_;
  btDbvtBroadphase broadphase_;
  std::unique_ptr<btMultiBody> body_;
  btMultiBodyConstraintSolver solver_;
  std::unique_ptr<btMultiBodyDynamicsWorld> world_;
  std::vector<std::unique_ptr<btMultiBodyGearConstraint>> gears_;
  std::vector<std::unique_ptr<btMultiBodyLinkCollider>> colliders_;
};

class BulletPeer : public Peer {
 public:
  BulletPeer(const Model& model, double dt, int environments, int sweeps)
      : joints_(static_cast<int>(model.joints.size())), dt_(dt), targets_(Eigen::VectorXd::Zero(joints_)) {
    for (int e = 0; e < environments; ++e) worlds_.push_back(std::make_unique<World>(shared_, model, sweeps));
    BulletPeer::reset();
  }

  void reset() override {
    for (auto& world : worlds_) world->reset();
  }
  void set_targets(const Eigen::VectorXd& targets) override { targets_ = targets; }
  void step() override {
    for (auto& world : worlds_) world->step(targets_, btScalar(dt_));
  }
  Eigen::VectorXd positions() const override {
    Eigen::VectorXd q(joints_);
    for (int j = 0; j < joints_; ++j) q[j] = worlds_[0]->position(j);
    return q;
  }

 private:
  Shared shared_;
  std::vector<std::unique_ptr<World>> worlds_;
  int joints_;
  double dt_;
  Eigen::VectorXd targets_;
};

}  // namespace

std::vector<Contender> bullet_contenders() {
  std::vector<Contender> all;
  for (const int sweeps : {10, 50})
    all.push_back({.engine = fmt::format("Bullet {}.{}", btGetVersion() / 100, btGetVersion() % 100),
                   .settings = fmt::format("pgs {}, f64", sweeps),
                   .exact = sweeps == 50,
                   .make = [sweeps](const Model& model, double dt, int environments) {
                     return std::make_unique<BulletPeer>(model, dt, environments, sweeps);
                   }});
  return all;
}

}  // namespace lockstep::peers
