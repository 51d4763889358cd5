// Finds the convex minimum by a search for the pieces that its curves are on. SPDX-License-Identifier: Apache-2.0
#include "convex.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace lockstep::reference {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double infinity = std::numeric_limits<double>::infinity();

constexpr double aim = 1e-13;      // violation at which the search stops
constexpr double enough = 1e-11;   // violation at which it stops once it makes little progress
constexpr double slack = 1e-13;    // distance beyond the end of a piece from which on the next piece is tried
constexpr double hopeless = 1e-7;  // a larger violation after first_rounds means that bounds contradict each other
constexpr int first_rounds = 20;
constexpr double compliance = 1e-9;  // of each curve during the search, relative to its own response
constexpr int proximal_rounds = 1000, joint_moves = 30, single_moves = 1000;

// Curves that hold speeds may depend on each other, and then their impulses are not unique. The proximal point method
// (Rockafellar 1976) makes them unique: each round takes u + delta (L - L_before) in place of u, where L_before are the
// impulses of the last round. The rounds come to rest only in a solution of the problem itself.
class Search {
 public:
  explicit Search(const Convex& problem)
      : problem_(problem),
        count_(static_cast<int>(problem.curves.size())),
        pieces_(count_),
        before_(VectorXd::Zero(count_)),
        response_(count_),
        v_(problem.momentum.size()),
        impulses_(count_) {
    const Eigen::LLT<MatrixXd> factor(problem.hessian);
    for (int i = 0; i < count_; ++i) {
      const Curve& curve = problem.curves[i];
      pieces_[i] = static_cast<int>(curve.pieces.size()) / 2;
      response_[i] = curve.direction.dot(factor.solve(curve.direction));
    }
  }

  Minimum run() {
    Minimum best;
    double least = infinity;
    for (int round = 0; round < proximal_rounds && least > aim; ++round) {
      if (!search()) throw std::logic_error("no choice of pieces fits all curves");
      const Minimum found{v_, impulses_, pieces_};
      const double now = violation(problem_, found);
      if (least <= enough && now > 0.5 * least) break;
      if (now < least) least = now, best = found;
      if (round >= first_rounds && least > hopeless) throw std::logic_error("bounds contradict each other");
      before_ = impulses_;
    }
    if (!(least <= enough)) throw std::logic_error("the search for the minimum did not come to an exact solution");
    return best;
  }

 private:
  // All violated curves change their piece at once, as in Newton's method. If that does not come to rest, the first
  // violated curve changes alone (Murty's rule). If that does not come to rest either, all choices are tried.
  bool search() {
    for (int move = 0; move < joint_moves; ++move) {
      solve();
      bool moved = false;
      for (int i = 0; i < count_; ++i)
        if (const int change = way(i); change != 0) pieces_[i] += change, moved = true;
      if (!moved) return true;
    }
    for (int move = 0; move < single_moves; ++move) {
      solve();
      int i = 0;
      while (i < count_ && way(i) == 0) ++i;
      if (i == count_) return true;
      pieces_[i] += way(i);
    }
    std::fill(pieces_.begin(), pieces_.end(), 0);
    do {
      solve();
      int i = 0;
      while (i < count_ && way(i) == 0) ++i;
      if (i == count_) return true;
    } while (next_choice());
    return false;
  }

  bool next_choice() {
    for (int i = 0; i < count_; ++i) {
      if (++pieces_[i] < static_cast<int>(problem_.curves[i].pieces.size())) return true;
      pieces_[i] = 0;
    }
    return false;
  }

  // H v - sum of direction L = p, and each curve's piece, as one linear system.
  void solve() {
    const int n = static_cast<int>(v_.size());
    MatrixXd matrix = MatrixXd::Zero(n + count_, n + count_);
    VectorXd right(n + count_);
    matrix.topLeftCorner(n, n) = problem_.hessian;
    right.head(n) = problem_.momentum;
    for (int i = 0; i < count_; ++i) {
      const Curve& curve = problem_.curves[i];
      const Piece& piece = curve.pieces[pieces_[i]];
      const double delta = compliance * response_[i];
      matrix.col(n + i).head(n) = -curve.direction;
      if (piece.holds) matrix.row(n + i).head(n) = curve.direction.transpose();
      matrix(n + i, n + i) = piece.holds ? piece.cfm + delta : 1.0;
      right[n + i] = piece.holds ? piece.value + delta * before_[i] : piece.value;
    }
    const VectorXd solution = matrix.fullPivLu().solve(right);
    v_ = solution.head(n);
    impulses_ = solution.tail(count_);
  }

  // The way to the right piece of the curve: -1 to the left, 1 to the right, 0 if this is it.
  int way(int i) const {
    const Curve& curve = problem_.curves[i];
    const Piece& piece = curve.pieces[pieces_[i]];
    const double u = curve.direction.dot(v_) + compliance * response_[i] * (impulses_[i] - before_[i]);
    const double speeds = slack * std::max(1.0, v_.lpNorm<Eigen::Infinity>());
    if (!piece.holds) return u < piece.from - speeds ? -1 : u > piece.to + speeds ? 1 : 0;
    const double impulses = speeds / response_[i];
    return impulses_[i] > piece.to + impulses ? -1 : impulses_[i] < piece.from - impulses ? 1 : 0;
  }

  const Convex& problem_;
  int count_;
  std::vector<int> pieces_;
  VectorXd before_, response_, v_, impulses_;
};

}  // namespace

std::vector<Piece> interval_pieces(double lo, double hi, double cfm) {
  if (lo == hi && cfm == 0.0) return {{true, lo, 0.0, -infinity, infinity}};
  std::vector<Piece> pieces;
  if (lo > -infinity) pieces.push_back({true, lo, cfm, 0.0, infinity});
  pieces.push_back({false, 0.0, 0.0, lo, hi});
  if (hi < infinity) pieces.push_back({true, hi, cfm, -infinity, 0.0});
  return pieces;
}

std::vector<Piece> box_pieces(double bias, double box, double cfm) {
  if (box == infinity) return {{true, -bias, cfm, -infinity, infinity}};
  return {{false, box, 0.0, -infinity, -bias - cfm * box},
          {true, -bias, cfm, -box, box},
          {false, -box, 0.0, -bias + cfm * box, infinity}};
}

Minimum minimum(const Convex& problem) { return Search(problem).run(); }

double violation(const Convex& problem, const Minimum& found) {
  const double speed = std::max(1.0, found.v.lpNorm<Eigen::Infinity>());
  const Eigen::LLT<MatrixXd> factor(problem.hessian);
  VectorXd residual = problem.hessian * found.v - problem.momentum;
  VectorXd size = problem.hessian.cwiseAbs() * found.v.cwiseAbs() + problem.momentum.cwiseAbs();
  double largest = 0.0;
  const auto count = [&](double amount, double scale) {
    largest = std::isfinite(amount) ? std::max(largest, amount / scale) : infinity;
  };
  for (std::size_t i = 0; i < problem.curves.size(); ++i) {
    const Curve& curve = problem.curves[i];
    const Piece& piece = curve.pieces[found.pieces[i]];
    const double u = curve.direction.dot(found.v), impulse = found.impulses[i];
    const double impulses = std::max(std::abs(impulse), speed / curve.direction.dot(factor.solve(curve.direction)));
    residual -= curve.direction * impulse;
    size += curve.direction.cwiseAbs() * std::abs(impulse);
    if (piece.holds) {
      count(std::abs(u + piece.cfm * impulse - piece.value), speed + piece.cfm * std::abs(impulse));
      count(std::max({piece.from - impulse, impulse - piece.to, 0.0}), impulses);
    } else {
      count(std::abs(impulse - piece.value), impulses);
      count(std::max({piece.from - u, u - piece.to, 0.0}), speed);
    }
  }
  count(residual.lpNorm<Eigen::Infinity>(), size.maxCoeff());
  return largest;
}

}  // namespace lockstep::reference
