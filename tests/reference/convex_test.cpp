// The convex minimum of the reference satisfies its optimality conditions. SPDX-License-Identifier: Apache-2.0
#include "reference/convex.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "random_bounds.h"

namespace lockstep::reference {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd random_definite(physics::Uniform& random, int n) {
  MatrixXd root(n, n);
  for (double& entry : root.reshaped()) entry = random(-1.0, 1.0);
  return root * root.transpose() + 0.05 * MatrixXd::Identity(n, n);
}

// A row of (M54) and its convex term, written without pieces.
struct Term {
  VectorXd direction;
  double lo, hi, cfm, box, bias;

  double energy(double u) const {
    const double beyond = std::max({lo - u, u - hi, 0.0}), off = u + bias;
    if (cfm == 0.0) return beyond > 0.0 ? infinity : box * std::abs(off);
    if (box == 0.0) return beyond * beyond / (2.0 * cfm);
    return std::abs(off) < cfm * box ? off * off / (2.0 * cfm) : box * (std::abs(off) - 0.5 * cfm * box);
  }
};

TEST(ConvexMinimum, satisfies_its_conditions_and_is_lower_than_points_around_it) {
  physics::Uniform random{std::mt19937_64(7)};
  for (int problem = 0; problem < 300; ++problem) {
    const int n = 1 + problem % 9;
    Convex convex{random_definite(random, n), VectorXd(n), {}};
    for (double& entry : convex.momentum) entry = random(-3.0, 3.0);
    std::vector<Term> terms;
    for (int i = 0; i < 8; ++i) {
      Term term{VectorXd::Zero(n), -infinity, infinity, 0.0, 0.0, 0.0};
      if (random(0.0, 1.0) < 0.6)
        term.direction[i % n] = 1.0;  // one joint may have several terms
      else
        for (double& entry : term.direction) entry = random(-1.0, 1.0);
      if (random(0.0, 1.0) < 0.5) term.cfm = random(0.01, 1.0);
      if (random(0.0, 1.0) < 0.5) {  // v = 0 satisfies all intervals
        term.lo = random(-0.5, 0.0);
        if (random(0.0, 1.0) < 0.5) term.hi = random(0.0, 0.5);
        convex.curves.push_back({term.direction, interval_pieces(term.lo, term.hi, term.cfm)});
      } else {
        term.box = random(0.0, 1.0), term.bias = random(-0.5, 0.5);
        convex.curves.push_back({term.direction, box_pieces(term.bias, term.box, term.cfm)});
      }
      terms.push_back(term);
    }
    const auto energy = [&](const VectorXd& v) {
      double sum = 0.5 * v.dot(convex.hessian * v) - convex.momentum.dot(v);
      for (const Term& term : terms) sum += term.energy(term.direction.dot(v));
      return sum;
    };
    const Minimum found = minimum(convex);
    ASSERT_LE(violation(convex, found), 1e-11) << problem;
    // Rounding may put the minimum outside of the intervals. A point between the minimum and zero is inside.
    const VectorXd inside = (1.0 - 1e-9) * found.v;
    const double least = energy(inside);
    ASSERT_LT(least, infinity) << problem;
    for (int k = 0; k < 200; ++k) {
      VectorXd there = inside;
      const double reach = std::pow(10.0, -random(0.0, 5.0));
      for (double& entry : there) entry += reach * random(-1.0, 1.0);
      ASSERT_GE(energy(there), least - 1e-7 * reach - 1e-9) << problem;
    }
  }
}

TEST(ConvexMinimum, is_found_where_curves_depend_on_each_other) {
  physics::Uniform random{std::mt19937_64(8)};
  for (int problem = 0; problem < 200; ++problem) {
    const int n = 3;
    Convex convex{random_definite(random, n), VectorXd(n), {}};
    for (double& entry : convex.momentum) entry = random(-1.0, 1.0);
    for (int i = 0; i < 6; ++i) {  // all contain zero, which is also the end of some intervals
      VectorXd direction = VectorXd::Zero(n);
      direction[i % 2] = random(0.5, 2.0), direction[2] = i < 4 ? 0.0 : 1.0;
      convex.curves.push_back(
          {direction, i % 3 == 0 ? interval_pieces(0.0, infinity, 0.0) : box_pieces(0.0, random(0.0, 1.0), 0.0)});
    }
    EXPECT_LE(violation(convex, minimum(convex)), 1e-11) << problem;
  }
}

TEST(ConvexMinimum, refuses_intervals_that_contradict_each_other) {
  Convex convex{MatrixXd::Identity(1, 1), VectorXd::Zero(1), {}};
  for (const double speed : {1.0, 2.0})
    convex.curves.push_back({VectorXd::Ones(1), interval_pieces(speed, speed, 0.0)});
  EXPECT_THROW(minimum(convex), std::logic_error);
}

}  // namespace
}  // namespace lockstep::reference
