// SPDX-License-Identifier: Apache-2.0
#include "functions.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "rules.h"
#include "tendons.h"

namespace lockstep {
namespace {

constexpr std::size_t fewest_coefficients = 2, most_coefficients = 16, fewest_points = 3, most_points = 1000;
constexpr double nearest_points = 1e-5;  // of a table's length: single precision tells them apart
constexpr double least_slope = 1e-4;     // of the largest

template <class... Case>
struct Cases : Case... {
  using Case::operator()...;
};
template <class... Case>
Cases(Case...) -> Cases<Case...>;

// The knot that a point of a table stands behind, as simd::spline() has it.
simd::Curve<double> spline_at(const CamTable& table, double x) {
  const std::vector<double> pieces = pieces_of(table);
  const auto after = std::upper_bound(table.leader.begin(), table.leader.end(), x);
  if (after == table.leader.begin()) return {pieces[0] + pieces[1] * (x - table.leader[0]), pieces[1], 0.0};
  const auto piece = static_cast<std::size_t>(after - table.leader.begin()) - 1;
  return simd::cubic(pieces.data() + simd::numbers_of_piece * piece, x - table.leader[piece]);
}

// ---------------------------------------------------------------- where f' may have its extremes

using Coefficients = std::vector<double>;

double value_of(const Coefficients& c, double x) {
  double sum = 0.0;
  for (std::size_t k = c.size(); k-- > 0;) sum = sum * x + c[k];
  return sum;
}

Coefficients derivative(const Coefficients& c) {
  Coefficients d;
  for (std::size_t k = 1; k < c.size(); ++k) d.push_back(static_cast<double>(k) * c[k]);
  return d;
}

// Between lower and upper. Between two neighbouring roots of its derivative, a polynomial has one root at most.
std::vector<double> roots_of(Coefficients c, double lower, double upper) {
  while (!c.empty() && c.back() == 0.0) c.pop_back();
  if (c.size() < 2) return {};
  std::vector<double> ends{lower}, roots;
  for (const double root : roots_of(derivative(c), lower, upper)) ends.push_back(root);
  ends.push_back(upper);
  for (std::size_t i = 0; i + 1 < ends.size(); ++i) {
    double a = ends[i], b = ends[i + 1];
    const double at_a = value_of(c, a);
    if (at_a == 0.0) roots.push_back(a);
    if (at_a * value_of(c, b) >= 0.0) continue;
    for (int halving = 0; halving < 200 && a < b; ++halving) {
      const double middle = 0.5 * (a + b);
      if (middle <= a || middle >= b) break;
      ((value_of(c, middle) < 0.0) == (at_a < 0.0) ? a : b) = middle;
    }
    roots.push_back(0.5 * (a + b));
  }
  return roots;
}

// All roots of the polynomial lie within this.
double root_bound(Coefficients c) {
  while (!c.empty() && c.back() == 0.0) c.pop_back();
  double largest = 0.0;
  for (const double number : c) largest = std::max(largest, std::abs(number / c.back()));
  return 1.0 + largest;
}

// Points of the range among which f' has its smallest and largest magnitude, or its values of both signs.
std::vector<double> extremes(const Polynomial& polynomial, const Range& range) {
  const Coefficients slope = derivative(polynomial.coefficients);
  const double far = std::max(root_bound(slope), root_bound(derivative(slope)));  // for ends that are infinite
  const double lower = std::isfinite(range.lower) ? range.lower : std::min(-far, range.upper);
  const double upper = std::isfinite(range.upper) ? range.upper : std::max(far, range.lower);
  std::vector<double> points{lower, upper};
  for (const double root : roots_of(derivative(slope), lower, upper)) points.push_back(root);
  return points;
}

std::vector<double> extremes(const CamTable& table, const Range& range) {
  const std::vector<double> pieces = pieces_of(table);
  std::vector<double> points{std::max(range.lower, table.leader.front() - 1.0),
                             std::min(range.upper, table.leader.back() + 1.0)};
  const auto add = [&](double x) {
    if (x > range.lower && x < range.upper) points.push_back(x);
  };
  for (std::size_t i = 0; i < table.leader.size(); ++i) {
    add(table.leader[i]);
    const double *const c = pieces.data() + simd::numbers_of_piece * i, flat = -c[2] / (3.0 * c[3]);
    if (i + 1 < table.leader.size() && flat > 0.0 && flat < table.leader[i + 1] - table.leader[i])
      add(table.leader[i] + flat);
  }
  return points;
}

std::vector<double> extremes(const Harmonic& h, const Range& range) {
  const double quarter = 0.5 * std::numbers::pi / std::abs(h.rate);
  if (!(range.upper - range.lower < 8.0 * quarter)) return {0.0, quarter, 2.0 * quarter, 3.0 * quarter};
  std::vector<double> points{range.lower, range.upper};
  const double crest = std::atan2(h.sine, h.cosine) / h.rate;
  for (double x = crest + std::ceil((range.lower - crest) / quarter) * quarter; x < range.upper; x += quarter)
    points.push_back(x);
  return points;
}

}  // namespace

simd::Curve<double> curve_at(const Function& function, double x) {
  return std::visit(
      Cases{
          [&](const Polynomial& p) {
            return simd::polynomial(p.coefficients.data(), static_cast<int>(p.coefficients.size()), x);
          },
          [&](const CamTable& table) { return spline_at(table, x); },
          [&](const Harmonic& h) {
            const double c = std::cos(h.rate * x), s = std::sin(h.rate * x);
            const double swing = h.cosine * c + h.sine * s;
            return simd::Curve<double>{h.mean + swing, h.rate * (h.sine * c - h.cosine * s), -h.rate * h.rate * swing};
          }},
      function);
}

std::vector<double> numbers_of(const Function& function) {
  return std::visit(
      Cases{[](const Polynomial& p) { return p.coefficients; }, [](const CamTable& table) { return table.follower; },
            [](const Harmonic& h) {
              return std::vector<double>{h.mean, h.cosine, h.sine};
            }},
      function);
}

void set_numbers(Function& function, const std::vector<double>& numbers) {
  std::visit(Cases{[&](Polynomial& p) { p.coefficients = numbers; }, [&](CamTable& table) { table.follower = numbers; },
                   [&](Harmonic& h) { h.mean = numbers[0], h.cosine = numbers[1], h.sine = numbers[2]; }},
             function);
}

std::vector<std::string> number_names(const Function& function) {
  if (std::holds_alternative<Harmonic>(function)) return {"mean", "cosine", "sine"};
  std::vector<std::string> names;
  for (std::size_t i = 0; i < numbers_of(function).size(); ++i)
    names.push_back(std::string(std::holds_alternative<Polynomial>(function) ? "c" : "y").append(std::to_string(i)));
  return names;
}

std::vector<double> pieces_of(const CamTable& table) {
  std::vector<double> pieces(simd::numbers_of_piece * table.leader.size());
  simd::spline_pieces(table.leader.data(), static_cast<int>(table.leader.size()), table.follower.data(), pieces.data());
  return pieces;
}

bool is_monotone(const Function& function, const Range& range) {
  double least = infinity, most = -infinity, largest = 0.0;
  for (const double x : std::visit([&](const auto& kind) { return extremes(kind, range); }, function)) {
    const double slope = curve_at(function, x).slope;
    least = std::min(least, slope), most = std::max(most, slope), largest = std::max(largest, std::abs(slope));
  }
  return largest > 0.0 && (least > least_slope * largest || most < -least_slope * largest);
}

void proper_function(const Coupling& coupling, const std::string& element) {
  require(coupling.terms.size() == 1 && coupling.terms[0].ratio == 1.0 && coupling.offset == 0.0, element,
          "is a function of one joint, and yet has several terms, a ratio or an offset",
          "give one term with the ratio 1 and no offset; both can be in the function");
  require(is_hard(coupling.softness) && coupling.force_limit == infinity, element,
          "is a function of one joint, and yet is soft or has a force limit",
          "leave it hard; put a spring or an effort limit between the follower and what it moves");
  const auto numbers = [&](const std::vector<double>& all, const char* what) {
    for (const double number : all) finite(number, element, what);
  };
  std::visit(Cases{[&](const Polynomial& p) {
                     require(p.coefficients.size() >= fewest_coefficients && p.coefficients.size() <= most_coefficients,
                             element, "has a polynomial of " + std::to_string(p.coefficients.size()) + " coefficients",
                             "give 2 to 16, or a table of points");
                     numbers(p.coefficients, "coefficient of the polynomial");
                   },
                   [&](const CamTable& table) {
                     const std::vector<double>& x = table.leader;
                     require(x.size() == table.follower.size(), element,
                             "has a table with " + std::to_string(x.size()) + " positions of the leader and " +
                                 std::to_string(table.follower.size()) + " of the follower",
                             "give one of each for each point");
                     require(x.size() >= fewest_points && x.size() <= most_points, element,
                             "has a table of " + std::to_string(x.size()) + " points", "give 3 to 1000");
                     numbers(x, "position of the leader in the table");
                     numbers(table.follower, "position of the follower in the table");
                     for (std::size_t i = 0; i + 1 < x.size(); ++i)
                       require(x[i + 1] - x[i] > nearest_points * (x.back() - x.front()), element,
                               "has a table whose positions of the leader do not ascend, or nearly coincide",
                               "sort the points by the leader's position, and leave out what is given twice");
                   },
                   [&](const Harmonic& h) {
                     numbers({h.mean, h.cosine, h.sine, h.rate}, "number of the harmonic");
                     require(h.rate != 0.0, element, "has a harmonic of rate 0, which stands still",
                             "give the rate in rad per rad or m of the leader, or make the follower a fixed joint");
                   }},
             *coupling.function);
}

std::vector<int> curved_couplings(const Model& model) {
  const std::vector<std::string> names = coupling_names(model);
  const auto count = static_cast<int>(model.couplings.size());
  const auto of = [&](int c) -> const Coupling& { return model.couplings[static_cast<std::size_t>(c)]; };
  const auto holds = [&](int c) { return is_hard(of(c).softness) && of(c).force_limit == infinity; };

  // Joints that follow a function, and the couplings that say so.
  std::set<std::string> curved;
  std::vector<char> taken(model.couplings.size(), 0);
  for (bool found = true; found;) {
    found = false;
    for (int c = 0; c < count; ++c) {
      const bool follows =
          of(c).function ||
          (holds(c) && std::any_of(of(c).terms.begin(), of(c).terms.end(),
                                   [&](const CouplingTerm& term) { return curved.count(term.joint) > 0; }));
      if (!follows || taken[static_cast<std::size_t>(c)]) continue;
      taken[static_cast<std::size_t>(c)] = 1;
      curved.insert(of(c).joint);
      found = true;
    }
  }

  // Each of these joints has one coupling.
  std::vector<int> waiting, order;
  for (int c = 0; c < count; ++c) {
    if (curved.count(of(c).joint) > 0 && holds(c))
      for (int other = 0; other < c; ++other)
        require(of(other).joint != of(c).joint || !holds(other), quoted("coupling", names[static_cast<std::size_t>(c)]),
                "says where joint '" + of(c).joint + "' is, and so does coupling '" +
                    names[static_cast<std::size_t>(other)] + "', through a function of a joint",
                "remove one of them, or make the linear one soft");
    if (taken[static_cast<std::size_t>(c)]) waiting.push_back(c);
  }

  // In order.
  while (!waiting.empty()) {
    const auto stands = [&](int c) {
      return std::none_of(of(c).terms.begin(), of(c).terms.end(), [&](const CouplingTerm& term) {
        return std::any_of(waiting.begin(), waiting.end(), [&](int w) { return of(w).joint == term.joint; });
      });
    };
    const auto next = std::find_if(waiting.begin(), waiting.end(), stands);
    require(next != waiting.end(), quoted("coupling", names[static_cast<std::size_t>(waiting.front())]),
            "is part of a ring of couplings with a function of a joint: its joints wait for each other",
            "break the ring: let one joint be free");
    order.push_back(*next);
    waiting.erase(next);
  }
  for (const int c : order) {
    require(!tendon_of(of(c), model), quoted("coupling", names[static_cast<std::size_t>(c)]),
            "says what the position of a tendon is, by a joint that follows a function of a joint",
            "let the tendon follow the leader of that function");
    // A leader may follow others, but not in a ring.
    for (const CouplingTerm& term : of(c).terms) {
      std::set<std::string> seen{of(c).joint};
      std::vector<std::string> open{term.joint};
      while (!open.empty()) {
        const std::string joint = open.back();
        open.pop_back();
        if (!seen.insert(joint).second) continue;
        for (int other = 0; other < count; ++other) {
          if (!holds(other) || of(other).joint != joint) continue;
          for (const CouplingTerm& leader : of(other).terms) {
            require(leader.joint != of(c).joint, quoted("coupling", names[static_cast<std::size_t>(c)]),
                    "is part of a ring of couplings with a function of a joint: its joints wait for each other",
                    "break the ring: let one joint be free");
            open.push_back(leader.joint);
          }
        }
      }
    }
  }
  return order;
}

void place_curved(const Model& model, const std::vector<int>& couplings, std::vector<double>& value,
                  std::vector<double>& rate) {
  const auto index = [&](const std::string& joint) { return static_cast<std::size_t>(model.joint_index(joint)); };
  for (const int c : couplings) {
    const Coupling& coupling = model.couplings[static_cast<std::size_t>(c)];
    double position = -coupling.offset, speed = 0.0;
    for (const CouplingTerm& term : coupling.terms) {
      const std::size_t leader = index(term.joint);
      const simd::Curve<double> curve = coupling.function
                                            ? curve_at(*coupling.function, value[leader])
                                            : simd::Curve<double>{-term.ratio * value[leader], -term.ratio, 0.0};
      position += curve.value, speed += curve.slope * rate[leader];
    }
    value[index(coupling.joint)] = position, rate[index(coupling.joint)] = speed;
  }
}

void place_curved(Model& model) {
  std::vector<double> value, rate;
  for (const Joint& joint : model.joints) value.push_back(joint.position), rate.push_back(joint.velocity);
  const std::vector<int> couplings = curved_couplings(model);
  if (couplings.empty()) return;
  place_curved(model, couplings, value, rate);
  for (const int c : couplings) {
    const auto j = static_cast<std::size_t>(model.joint_index(model.couplings[static_cast<std::size_t>(c)].joint));
    model.joints[j].position = value[j], model.joints[j].velocity = rate[j];
  }
}

}  // namespace lockstep
