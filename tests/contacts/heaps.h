// Random heaps of a box, balls and a rod on a floor. SPDX-License-Identifier: Apache-2.0
//
// Each number is drawn in a statement of its own: no compiler chooses the order of arguments, and so the scene.
#pragma once

#include <cmath>
#include <random>

#include "contact_scenes.h"

namespace lockstep::contact_scenes {

/// A ball on a box on the floor, a second ball beside them, and a capsule; all near each other and moving.
inline Model heap(unsigned seed) {
  std::mt19937 generator(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
  };
  Model model;
  model.name = "heap";
  const auto mass = [&] { return std::pow(10.0, uniform(-1.0, 1.0)); };
  {
    const double friction = uniform(0.2, 1.0), height = 0.04 + uniform(-1e-3, 1e-3), m = mass();
    add_block(model, "box", m, {0.1, 0.12, 0.08}, {0, 0, height}, friction);
    const double y = uniform(-1, 1), x = uniform(-1, 1), angle = uniform(-0.01, 0.01);
    model.roots.back().pose.linear() = Eigen::AngleAxisd(angle, Vector3d(x, y, 3).normalized()).toRotationMatrix();
  }
  for (const auto& [name, place] :
       {std::pair("top", Vector3d(0.02, 0.01, 0.11)), std::pair("side", Vector3d(0.08, 0.0, 0.03))}) {
    const double m = mass(), friction = uniform(0.2, 1.0), higher = uniform(-1e-3, 1e-3);
    add_free(model, name, {m, Vector3d::Zero(), m * 3.6e-4 * Eigen::Matrix3d::Identity()}, Shape::sphere(0.03),
             place + Vector3d(0, 0, higher), friction);
  }
  const double m = mass();
  add_free(model, "rod", {m, Vector3d::Zero(), m * Vector3d(1e-3, 1e-3, 2e-4).asDiagonal().toDenseMatrix()},
           Shape::capsule(0.02, 0.1), {0.0, 0.3, 0.02}, uniform(0.2, 1.0));
  model.roots.back().pose.linear() = Eigen::AngleAxisd(std::acos(0.0), Vector3d::UnitY()).toRotationMatrix();
  add_floor(model, uniform(0.2, 1.0));
  model.contacts = {{"floor", "box"}, {"floor", "side"}, {"floor", "rod"}, {"box", "top"}, {"box", "side"}};
  for (Root& root : model.roots)
    for (int k = 0; k < 6; ++k) root.velocity[k] = uniform(-0.3, 0.3);
  return model;
}

/// The heap's contacts take turns in being soft and in bouncing, and some begin deep inside of each other.
inline Model lively_heap(unsigned seed) {
  Model model = heap(seed);
  std::mt19937 generator(seed + 1000);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
  };
  for (Contact& contact : model.contacts) {
    if (uniform(0, 1) < 0.5) contact.restitution = uniform(0.1, 1.0);
    const double kind = uniform(0, 1);
    if (kind < 0.2)
      contact.softness = Spring{std::pow(10.0, uniform(2, 5)), std::pow(10.0, uniform(0, 2))};
    else if (kind < 0.4)
      contact.softness = Frequency{uniform(30, 300), uniform(0.1, 2.0)};
  }
  for (Root& root : model.roots) root.pose.translation().z() -= uniform(0.0, 4e-3);
  return model;
}

/// The lively heap turns faster, and most of its contacts resist that.
inline Model turning_heap(unsigned seed) {
  Model model = lively_heap(seed);
  std::mt19937 generator(seed + 2000);
  std::uniform_real_distribution<double> exponent(-4.0, -1.5), share(0.0, 1.0);
  for (Contact& contact : model.contacts) {
    if (share(generator) < 0.7) contact.torsional_friction = std::pow(10.0, exponent(generator));
    if (share(generator) < 0.7) contact.rolling_friction = std::pow(10.0, exponent(generator));
  }
  for (Root& root : model.roots) root.velocity.head(3) *= 10.0;
  return model;
}

/// A cylinder that stands, one that lies, an egg and a stone on a floor, a ball at each of them.
inline Model solid_heap(unsigned seed) {
  std::mt19937 generator(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
  };
  Model model;
  model.name = "solid heap";
  Eigen::Matrix3Xd stone(3, 20);
  for (int i = 0; i < 20; ++i) {
    const double x = uniform(-1, 1), y = uniform(-1, 1), z = uniform(-1, 1);
    stone.col(i) = 0.04 * Vector3d(x, y, z).normalized();
  }
  const double lowest = -stone.row(2).minCoeff();
  const struct {
    const char* name;
    Shape shape;
    double height, reach;  // of the centre, and to the side
  } solids[] = {{"can", Shape::cylinder(0.04, 0.1), 0.05, 0.04},
                {"roll", Shape::cylinder(0.03, 0.08), 0.03, 0.03},
                {"egg", Shape::ellipsoid({0.05, 0.04, 0.03}), 0.03, 0.05},
                {"stone", Shape::hull(stone, 0.005), lowest + 0.005, 0.045}};
  double x = 0.0;
  for (const auto& solid : solids) {
    const double m = std::pow(10.0, uniform(-1.0, 1.0)), friction = uniform(0.2, 1.0), higher = uniform(-1e-3, 1e-3);
    add_free(model, solid.name, {m, Vector3d::Zero(), m * Vector3d(8e-4, 9e-4, 7e-4).asDiagonal().toDenseMatrix()},
             solid.shape, {x, 0, solid.height + higher}, friction);
    Pose& pose = model.roots.back().pose;
    if (solid.name == std::string("roll"))
      pose.linear() = Eigen::AngleAxisd(std::acos(0.0), Vector3d(1, uniform(-1, 1), 0).normalized()).toRotationMatrix();
    const double tilt = solid.name == std::string("stone") ? 0.0 : 0.01;
    const double axis = uniform(-1, 1), angle = uniform(-tilt, tilt);
    pose.linear() = Eigen::AngleAxisd(angle, Vector3d(axis, 1, 0).normalized()).toRotationMatrix() * pose.linear();
    const std::string ball = std::string("ball_at_") + solid.name;
    const double friction_of_ball = uniform(0.2, 1.0), apart = uniform(-1e-3, 2e-3), above = uniform(0.0, 0.01);
    add_free(model, ball, {0.2, Vector3d::Zero(), 3.2e-5 * Eigen::Matrix3d::Identity()}, Shape::sphere(0.02),
             {x + solid.reach + 0.02 + apart, 0, solid.height + above}, friction_of_ball);
    x += 0.3;
  }
  add_floor(model, uniform(0.2, 1.0));
  for (const auto& solid : solids) {
    model.contacts.push_back({"floor", solid.name});
    model.contacts.push_back({solid.name, std::string("ball_at_") + solid.name});
  }
  for (Root& root : model.roots)
    for (int k = 0; k < 6; ++k) root.velocity[k] = uniform(-0.3, 0.3);
  return model;
}

}  // namespace lockstep::contact_scenes
