// Batch::linearize(): centred differences of a step (M144). SPDX-License-Identifier: Apache-2.0
//
// Each environment is copied twice for each coordinate, input and parameter, once moved a little forwards and once
// backwards. Placing followers and closing loops may move other coordinates too, so it is measured where the copies
// start, and the derivatives are solved for.
#include <fmt/format.h>

#include <Eigen/LU>

#include "coordinates.h"
#include "impl.h"
#include "model/rotations.h"

namespace lockstep {
namespace {

constexpr double coarsest_tolerance = 1e-8;
constexpr int most_copies = 512;  // at once
constexpr double slipped = 2e-3;  // rad or m: the error of what has a force limit and did not hold

void check_options(const Plan& plan, const LinearizeOptions& options) {
  if (options.substeps < 1)
    throw UsageError("number of substeps", fmt::format("is {}", options.substeps), "give 1 or more");
  if (!(options.step > 0.0 && options.step <= 0.1))
    throw UsageError("step of differences", fmt::format("is {}, outside (0, 0.1]", options.step), "give 1e-6");
  if (options.inputs != ActionKind::position && options.inputs != ActionKind::velocity &&
      options.inputs != ActionKind::effort)
    throw UsageError("kind of actions", "is no input of its own", "give position, velocity or effort");
  for (const ParameterRow& row : options.parameters) {
    if (!plan.settings().per_environment.contains(row.parameter))
      throw UsageError(std::string("field ") + to_string(row.parameter), "was not declared",
                       "add it to StepSettings::per_environment");
    if (row.row < 0 || row.row >= plan.parameter_rows(row.parameter))
      throw UsageError(std::string("field ") + to_string(row.parameter),
                       fmt::format("has {} rows, so no row {}", plan.parameter_rows(row.parameter), row.row),
                       "see Plan::parameter_row_names()");
    if (row.parameter == Parameter::coupling_switch || row.parameter == Parameter::loop_switch)
      throw UsageError(std::string("field ") + to_string(row.parameter), "is on or off, and has no derivative",
                       "leave it out");
  }
  if (program_of(plan).f64.actuators.is_late())
    throw UsageError("plan", "has drives with a delay or a lag, whose memory is no part of the state",
                     "compile the model with Drive::delay and Drive::lag 0");
  const double tolerance = plan.settings().contacts.tolerance;
  if (program_of(plan).f64.counts_solves() && tolerance > coarsest_tolerance)
    throw UsageError("ContactSettings::tolerance",
                     fmt::format("is {}, and differences need {} or less where contacts or limits are solved in rounds",
                                 tolerance, coarsest_tolerance),
                     "compile with ContactSettings::tolerance = 1e-10 and 100 rounds");
}

template <class S>
void check_loops_hold(const Plan& plan, const StatePointers<S>& rows, std::span<const int> ids) {
  for (const Loop& loop : plan.model().loops)
    if (!is_hard(loop.softness))
      throw UsageError("loop '" + loop.name + "'", "is soft, so its joints are coordinates of their own",
                       "make it hard, or leave it out");
  const S* const on = rows.field(Parameter::loop_switch);
  if (!on) return;
  for (std::size_t l = 0; l < plan.loops().size(); ++l)
    for (const int e : ids)
      if (on[static_cast<std::ptrdiff_t>(l) * rows.stride + e] == S(0))
        throw UsageError(fmt::format("environment {}", e),
                         "has the loop '" + plan.loops()[l].name + "' off, so its joints are free",
                         "switch it on, or compile a model without it");
}

// Errors: of couplings, then of loops; of others than `ids` whatever.
template <class Errors>
void check_nothing_slipped(const Plan& plan, const Errors& couplings, const Errors& loops, std::span<const int> ids) {
  const auto check = [&](const std::string& name, double limit, const auto& error_of) {
    if (!(limit < infinity)) return;
    for (const int e : ids)
      if (error_of(e) > slipped)
        throw UsageError(fmt::format("environment {}", e),
                         fmt::format("has {} slipped, by {:.3g}, so its joints are free", name, error_of(e)),
                         "raise its force limit, or linearize where it holds");
  };
  const Model& model = plan.model();
  const std::vector<std::string> names = coupling_names(model);
  for (std::size_t c = 0; c < model.couplings.size(); ++c)
    if (is_hard(model.couplings[c].softness))  // followers of others are coordinates of their own
      check("the coupling '" + names[c] + "'", model.couplings[c].force_limit,
            [&](int e) { return std::abs(static_cast<double>(couplings(static_cast<Eigen::Index>(c), e))); });
  for (std::size_t l = 0; l < model.loops.size(); ++l)
    check("the loop '" + model.loops[l].name + "'", std::min(model.loops[l].force_limit, model.loops[l].torque_limit),
          [&](int e) {
            return static_cast<double>(loops.col(e).segment(2 * static_cast<Eigen::Index>(l), 2).maxCoeff());
          });
}

// A limit that is infinite, or a number that may be no other, has no difference.
void require_difference(const ParameterRow& row, double forwards, double backwards, int environment) {
  if (forwards != backwards) return;  // NaN is a fault
  throw UsageError(
      std::string("field ") + to_string(row.parameter),
      fmt::format("has {} in row {} of environment {}, which cannot be moved", forwards, row.row, environment),
      "leave the row out");
}

// What copies are moved by: a coordinate of the state, an input or a parameter.
class Differences {
 public:
  Differences(const Plan& plan, const LinearizeOptions& options, const ValueRules<double>& rules)
      : plan_(plan),
        options_(options),
        dofs_(coordinate_dofs(plan)),
        inputs_(options.inputs == ActionKind::effort ? plan.independent_dofs() : plan.driven_dofs()),
        roots_(static_cast<int>(plan.root_names().size())) {
    for (const Query& query : options.record) rows_ += plan.query_rows(query);
    for (const ParameterRow& row : options.parameters) {
      rules_.emplace_back();
      for (const ValueRule<double>& rule : rules.rows)
        if (rule.field == row.parameter && rule.row == row.row) rules_.back().push_back(&rule);
    }
  }

  int half() const { return static_cast<int>(dofs_.size()) + 6 * roots_; }  // of the state: positions or velocities
  int states() const { return 2 * half(); }
  int inputs() const { return static_cast<int>(inputs_.size()); }
  int parameters() const { return static_cast<int>(options_.parameters.size()); }
  int columns() const { return states() + inputs() + parameters(); }
  int rows() const { return rows_; }

  /// Moves environment e along a column, forwards or backwards, unless a parameter would leave its range. Returns the
  /// number moved, as it stands then, if it is an input or a parameter.
  double move(Batch<double>& batch, int e, int column, double sign) const {
    const int dofs = static_cast<int>(dofs_.size());
    const double step = sign * options_.step;
    if (column < states()) {
      const bool of_positions = column < half();
      const int k = of_positions ? column : column - half();
      if (k < dofs)
        (of_positions ? batch.positions() : batch.velocities())(dofs_[static_cast<std::size_t>(k)], e) += step;
      else if (of_positions)
        move_root(batch, e, (k - dofs) / 6, (k - dofs) % 6, step);
      else
        batch.root_velocities()(k - dofs, e) += step;
      return 0.0;
    }
    if (const int k = column - states(); k < inputs()) {
      auto all = options_.inputs == ActionKind::effort     ? batch.efforts()
                 : options_.inputs == ActionKind::velocity ? batch.velocity_targets()
                                                           : batch.position_targets();
      const int dof = inputs_[static_cast<std::size_t>(k)];
      for (Eigen::Index row = dof; row < all.rows(); row += plan_.dofs()) all(row, e) += step;
      return all(dof, e);
    }
    const auto k = static_cast<std::size_t>(column - states() - inputs());
    double& number = batch.parameter(options_.parameters[k].parameter)(options_.parameters[k].row, e);
    const double moved = number + (number == 0.0 ? step : step * std::abs(number));
    const bool leaves =
        std::ranges::any_of(rules_[k], [&](const auto* rule) { return rule->holds(number) && !rule->holds(moved); });
    return leaves ? number : number = moved;
  }

  /// State of one batch, from which differences are taken: copies of the arrays.
  struct States {
    Batch<double>::Array angles, turns, velocities, root_poses, root_velocities, record;
  };
  States states_of(const Batch<double>& batch, bool with_record) const {
    States all{batch.angles(),     batch.turns(),           batch.velocities(),
               batch.root_poses(), batch.root_velocities(), Batch<double>::Array(rows_, batch.environments())};
    if (with_record && rows_ > 0) batch.read(options_.record, {all.record.data(), all.record.outerStride(), 1});
    return all;
  }

  /// (M144): of environment `forwards` less environment `backwards`, in coordinates of the state.
  Eigen::VectorXd state_difference(const States& all, int forwards, int backwards) const {
    const auto dofs = static_cast<Eigen::Index>(dofs_.size());
    Eigen::VectorXd difference(states());
    const Eigen::VectorXd way = position_difference(all, forwards, backwards);
    for (Eigen::Index k = 0; k < dofs; ++k) {
      const int dof = dofs_[static_cast<std::size_t>(k)];
      difference[k] = way[dof];
      difference[half() + k] = all.velocities(dof, forwards) - all.velocities(dof, backwards);
    }
    for (int r = 0; r < roots_; ++r) {
      const auto place = [&](int e) -> Eigen::Vector3d { return all.root_poses.col(e).segment<3>(7 * r).matrix(); };
      const Eigen::Quaterniond turn = quaternion(all.root_poses, 7 * r + 3, backwards);
      const Eigen::Vector3d angle = rotation_vector(turn.conjugate() * quaternion(all.root_poses, 7 * r + 3, forwards));
      const Eigen::Quaterniond middle = turn * turned_by(0.5 * angle);
      difference.segment<3>(dofs + 6 * r) = angle;
      difference.segment<3>(dofs + 6 * r + 3) = middle.conjugate() * (place(forwards) - place(backwards));
    }
    difference.tail(6 * roots_) = (all.root_velocities.col(forwards) - all.root_velocities.col(backwards)).matrix();
    return difference;
  }

  /// Of the rows of the queries. A quaternion and its opposite are the same turn. What is infinite in both is equal.
  Eigen::VectorXd record_difference(const States& all, int forwards, int backwards) const {
    Eigen::VectorXd difference = (all.record.col(forwards) - all.record.col(backwards)).matrix();
    for (Eigen::Index k = 0; k < difference.size(); ++k)
      if (all.record(k, forwards) == all.record(k, backwards)) difference[k] = 0.0;
    int row = 0;
    for (const Query& query : options_.record) {
      const int end = row + plan_.query_rows(query);
      const bool of_poses = query.quantity == Quantity::link_pose || query.quantity == Quantity::site_pose ||
                            query.quantity == Quantity::root_pose;
      for (int k = row + 3; of_poses && k < end; k += 7) {
        const Eigen::Vector4d a = all.record.col(forwards).segment<4>(k).matrix(),
                              b = all.record.col(backwards).segment<4>(k).matrix();
        if (a.dot(b) < 0.0) difference.segment<4>(k) = a + b;
      }
      if (query.quantity == Quantity::position) {
        const Eigen::VectorXd way = position_difference(all, forwards, backwards);
        for (int k = row; k < end; ++k) {
          const auto element = static_cast<std::size_t>(k - row);
          difference[k] = query.scale * way[query.elements.empty() ? k - row : query.elements[element]];
        }
      }
      row = end;
    }
    return difference;
  }

 private:
  static Eigen::Quaterniond quaternion(const Batch<double>::Array& rows, int first, int e) {
    return Eigen::Quaterniond(rows(first, e), rows(first + 1, e), rows(first + 2, e), rows(first + 3, e)).normalized();
  }

  // By dof, with whole turns, and with both vectors of a ball's turn on one side of pi.
  Eigen::VectorXd position_difference(const States& all, int forwards, int backwards) const {
    Eigen::VectorXd ahead = all.angles.col(forwards).matrix();
    const auto behind = all.angles.col(backwards).matrix();
    const TableStructure& t = program_of(plan_).f64;
    for (int b = 0; b < t.balls.count; ++b) {
      auto own = ahead.segment<3>(t.dof[t.balls[b].joint]);
      if ((own - behind.segment<3>(t.dof[t.balls[b].joint])).norm() > std::numbers::pi)
        own *= 1.0 - 2.0 * std::numbers::pi / own.norm();
    }
    return ahead - behind + 2.0 * std::numbers::pi * (all.turns.col(forwards) - all.turns.col(backwards)).matrix();
  }

  // Along or about an axis of its own.
  static void move_root(Batch<double>& batch, int e, int root, int axis, double step) {
    auto pose = batch.root_poses().col(e).segment<7>(7 * root);
    const Eigen::Quaterniond turn = Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6]).normalized();
    const Eigen::Vector3d by = step * Eigen::Vector3d::Unit(axis % 3);
    if (axis >= 3) {
      pose.head<3>() += (turn * by).array();
      return;
    }
    const Eigen::Quaterniond now = turn * turned_by(by);
    pose[3] = now.w(), pose[4] = now.x(), pose[5] = now.y(), pose[6] = now.z();
  }

  const Plan& plan_;
  const LinearizeOptions& options_;
  std::vector<int> dofs_, inputs_;
  std::vector<std::vector<const ValueRule<double>*>> rules_;  // by parameter; none for any number
  int roots_, rows_ = 0;
};

// Of one environment, by column.
struct Measured {
  Fault fault = Fault::none;
  Eigen::MatrixXd start, end, record;
  Eigen::VectorXd number;  // how far an input or a parameter was moved
};

Linearization solved(const Measured& measured, const Differences& of, int environment) {
  const int states = of.states(), inputs = of.inputs(), parameters = of.parameters();
  Linearization result;
  result.fault = measured.fault;
  const auto part = [&](const Eigen::MatrixXd& end, Eigen::MatrixXd& by_state, Eigen::MatrixXd& by_input,
                        Eigen::MatrixXd& by_parameter) {
    if (measured.fault != Fault::none) {
      constexpr double none = std::numeric_limits<double>::quiet_NaN();
      by_state.setConstant(end.rows(), states, none), by_input.setConstant(end.rows(), inputs, none);
      by_parameter.setConstant(end.rows(), parameters, none);
      return;
    }
    // by_state * start = end, with the coordinates that each column moves.
    Eigen::FullPivLU<Eigen::MatrixXd> start(measured.start.leftCols(states).transpose());
    start.setThreshold(1e-6);
    if (!start.isInvertible())
      throw UsageError(fmt::format("environment {}", environment),
                       "stands where its loops leave coordinates of the state no motion of their own",
                       "move it away from there");
    by_state = start.solve(end.leftCols(states).transpose()).transpose();
    by_input = end.middleCols(states, inputs);
    by_parameter = end.rightCols(parameters) - by_state * measured.start.rightCols(parameters);
    for (int k = 0; k < inputs; ++k) by_input.col(k) /= measured.number[states + k];
    for (int k = 0; k < parameters; ++k) by_parameter.col(k) /= measured.number[states + inputs + k];
  };
  part(measured.end, result.state_by_state, result.state_by_input, result.state_by_parameter);
  part(measured.record, result.record_by_state, result.record_by_input, result.record_by_parameter);
  return result;
}

}  // namespace

template <class S>
std::vector<Linearization> Batch<S>::linearize(const EnvironmentSet& which, const LinearizeOptions& options) const {
  if constexpr (std::is_same_v<S, float>) {
    throw UsageError("batch", "is of single precision, whose differences would be rounding", "use Batch<double>");
  } else {
    Impl& own = impl();
    check_options(own.plan, options);
    std::vector<int> ids;
    which.for_each(own.environments, [&](int e) { ids.push_back(e); });
    check_couplings_hold(own.plan, own.state_pointers(), ids);
    std::vector<int> good;
    std::ranges::copy_if(ids, std::back_inserter(good),
                         [&](int e) { return faults()[static_cast<std::size_t>(e)] == Fault::none; });
    check_loops_hold(own.plan, own.state_pointers(), good);
    check_nothing_slipped(own.plan, coupling_errors(), loop_errors(), good);
    const Differences differences(own.plan, options, own.rules);
    const std::vector<std::byte> bytes = save(ids);
    const Blob blob = read_blob(bytes);

    const int columns = differences.columns(), jobs = static_cast<int>(ids.size()) * columns;
    std::vector<Measured> measured(ids.size());
    for (Measured& m : measured) {
      m.start.resize(differences.states(), columns), m.end.resize(differences.states(), columns);
      m.record.resize(differences.rows(), columns), m.number.resize(columns);
    }
    if (jobs == 0) return std::vector<Linearization>(ids.size());
    const int copies = std::min(2 * jobs, most_copies);
    Batch<S> workspace(own.plan, copies,
                       {own.workers.threads(), own.target, own.chosen.engine, 0, 0, own.workers.memory_domain()});
    std::vector<int> places(static_cast<std::size_t>(copies)), from(places.size());
    std::iota(places.begin(), places.end(), 0);

    // Copies that are left over from the jobs before are stepped along.
    for (int first = 0; first < jobs; first += copies / 2) {
      const int count = std::min(copies / 2, jobs - first);
      const std::span<const int> used(places.data(), static_cast<std::size_t>(2 * count));
      for (int i = 0; i < 2 * count; ++i) from[static_cast<std::size_t>(i)] = (first + i / 2) / columns;
      workspace.impl().restore(blob, used, std::span(from).first(used.size()), false);
      for (int i = 0; i < count; ++i) {
        const int column = (first + i) % columns;
        const double forwards = differences.move(workspace, 2 * i, column, 1.0);
        const double backwards = differences.move(workspace, 2 * i + 1, column, -1.0);
        measured[static_cast<std::size_t>((first + i) / columns)].number[column] = forwards - backwards;
        if (const int k = column - differences.states() - differences.inputs(); k >= 0)
          require_difference(options.parameters[static_cast<std::size_t>(k)], forwards, backwards,
                             ids[static_cast<std::size_t>((first + i) / columns)]);
      }
      for (const UnmetCoupling& unmet : workspace.project(used))
        if (workspace.faults()[static_cast<std::size_t>(unmet.environment)] == Fault::none)
          throw UsageError(
              fmt::format("environment {}", ids[static_cast<std::size_t>((first + unmet.environment / 2) / columns)]),
              "has a coupling or loop that cannot be met", "see Batch::project()");
      const auto start = differences.states_of(workspace, false);
      workspace.step(options.substeps);
      const auto end = differences.states_of(workspace, true);
      for (int i = 0; i < count; ++i) {
        const int column = (first + i) % columns;
        Measured& m = measured[static_cast<std::size_t>((first + i) / columns)];
        m.start.col(column) = differences.state_difference(start, 2 * i, 2 * i + 1);
        m.end.col(column) = differences.state_difference(end, 2 * i, 2 * i + 1);
        m.record.col(column) = differences.record_difference(end, 2 * i, 2 * i + 1);
        for (const int copy : {2 * i, 2 * i + 1})
          if (m.fault == Fault::none) m.fault = workspace.faults()[static_cast<std::size_t>(copy)];
      }
    }

    std::vector<Linearization> result;
    for (std::size_t i = 0; i < ids.size(); ++i) result.push_back(solved(measured[i], differences, ids[i]));
    return result;
  }
}

template std::vector<Linearization> Batch<float>::linearize(const EnvironmentSet&, const LinearizeOptions&) const;
template std::vector<Linearization> Batch<double>::linearize(const EnvironmentSet&, const LinearizeOptions&) const;

}  // namespace lockstep
