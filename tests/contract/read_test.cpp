// read() writes what queries ask for into the caller's memory. SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "contract.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using contract::scattered;

Model with_sites() {
  scenes::RandomOptions options;
  options.root = scenes::RandomOptions::Root::floating;
  options.min_dofs = 6;
  Model model = scenes::random_model(11, options);
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  pose.translation() = Eigen::Vector3d(0.1, -0.2, 0.3);
  model.add_site("turned", model.links.back().name, pose);
  return model;
}

constexpr int quantities = static_cast<int>(Quantity::potential_energy) + 1;  // that models without contacts have

// Memory of the caller, filled with a number that no readback computes.
template <class S>
struct Memory {
  static constexpr S unwritten = S(-12345);
  Memory(int rows, int environments, std::ptrdiff_t row_stride, std::ptrdiff_t environment_stride)
      : numbers(static_cast<std::size_t>((rows - 1) * row_stride + (environments - 1) * environment_stride + 1),
                unwritten),
        view{numbers.data(), row_stride, environment_stride} {}
  S at(int row, int e) const {
    return numbers[static_cast<std::size_t>(row * view.row_stride + e * view.environment_stride)];
  }
  std::vector<S> numbers;
  StridedRows<S> view;
};

template <class S>
using Array = typename Batch<S>::Array;

// [rows][environments]
template <class S>
Array<S> answer(const Batch<S>& batch, const std::vector<Query>& queries) {
  int rows = 0;
  for (const Query& query : queries) rows += batch.plan().query_rows(query);
  Array<S> numbers = Array<S>::Constant(rows, batch.environments(), Memory<S>::unwritten);
  batch.read(queries, {numbers.data(), numbers.outerStride()});
  return numbers;
}

// What the views and the simple readbacks say of a quantity.
template <class S>
Array<S> expected(Batch<S>& batch, Quantity quantity) {
  const Plan& plan = batch.plan();
  const auto stacked = [&](std::size_t count, const auto& part) {
    Array<S> rows(0, batch.environments());
    for (std::size_t i = 0; i < count; ++i) {
      const Array<S> more = part(static_cast<int>(i));
      rows.conservativeResize(rows.rows() + more.rows(), Eigen::NoChange);
      rows.bottomRows(more.rows()) = more;
    }
    return rows;
  };
  switch (quantity) {
    case Quantity::position: return batch.positions();
    case Quantity::velocity: return batch.velocities();
    case Quantity::position_target: return batch.position_targets();
    case Quantity::velocity_target: return batch.velocity_targets();
    case Quantity::effort: return batch.efforts();
    case Quantity::link_pose: return stacked(plan.model().links.size(), [&](int l) { return batch.link_poses(l); });
    case Quantity::link_velocity:
      return stacked(plan.model().links.size(), [&](int l) { return batch.link_velocities(l); });
    case Quantity::site_position:
      return stacked(plan.model().sites.size(), [&](int s) { return batch.site_positions(s); });
    case Quantity::coupling_error: return batch.coupling_errors();
    case Quantity::root_pose: return batch.root_poses();
    case Quantity::root_velocity: return batch.root_velocities();
    case Quantity::kinetic_energy: return batch.kinetic_energies();
    case Quantity::potential_energy: return batch.potential_energies();
    default: return answer(batch, {{quantity}});  // of sites: see below
  }
}

template <class S>
class Read : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Read, Scalars);

TYPED_TEST(Read, agrees_with_views_and_simple_readbacks_to_the_last_bit) {
  using S = TypeParam;
  constexpr int environments = 37;
  const Plan plan = compile(
      with_sites(), {.integrator = Integrator::euler, .per_environment = {Parameter::gear_ratio, Parameter::mass}});
  for (int threads : {1, 2}) {
    Batch<S> batch = scattered<S>(plan, environments, {.threads = threads});
    batch.step(3);
    std::vector<Query> all;
    int rows = 0;
    for (int q = 0; q < quantities; ++q) {
      all.push_back({static_cast<Quantity>(q)});
      rows += plan.query_rows(all.back());
    }
    // Strides row by row with gaps, environment by environment, and both.
    const std::ptrdiff_t strides[][2] = {{environments + 5, 1}, {1, rows}, {3, 3 * rows + 1}};
    for (const auto& [row_stride, environment_stride] : strides) {
      Memory<S> memory(rows, environments, row_stride, environment_stride);
      batch.read(all, memory.view);
      std::size_t written = 0;
      for (const S number : memory.numbers) written += number != Memory<S>::unwritten;
      EXPECT_EQ(written, static_cast<std::size_t>(rows * environments));
      int row = 0;
      for (const Query& query : all) {
        const Array<S> right = expected(batch, query.quantity);
        ASSERT_EQ(right.rows(), plan.query_rows(query)) << to_string(query.quantity);
        for (Eigen::Index k = 0; k < right.rows(); ++k, ++row)
          for (int e = 0; e < environments; ++e)
            ASSERT_EQ(memory.at(row, e), right(k, e)) << to_string(query.quantity) << " " << k << " " << e;
      }
    }
  }
}

TYPED_TEST(Read, takes_elements_in_any_order_and_scales_them) {
  using S = TypeParam;
  Batch<S> batch = scattered<S>(compile(with_sites()), 9);
  const int last = static_cast<int>(batch.plan().model().links.size()) - 1;
  for (const auto& [quantity, rows] : {std::pair(Quantity::link_velocity, 6), std::pair(Quantity::link_pose, 7),
                                       std::pair(Quantity::velocity, 1), std::pair(Quantity::effort, 1)}) {
    const int second = rows == 1 ? 4 : last;
    const Array<S> whole = expected(batch, quantity),
                   some = answer(batch, {{quantity, {second, 1, second}, -0.5}, {quantity, {0}}});
    ASSERT_EQ(some.rows(), 4 * rows);
    EXPECT_TRUE((some.topRows(rows) == S(-0.5) * whole.middleRows(rows * second, rows)).all());
    EXPECT_TRUE((some.middleRows(rows, rows) == S(-0.5) * whole.middleRows(rows, rows)).all());
    EXPECT_TRUE((some.middleRows(2 * rows, rows) == some.topRows(rows)).all());
    EXPECT_TRUE((some.bottomRows(rows) == whole.topRows(rows)).all());
  }
  EXPECT_TRUE((answer(batch, {{Quantity::kinetic_energy, {}, 2.0}}) == S(2) * batch.kinetic_energies()).all());
}

TEST(ReadOfSites, turn_with_their_links_and_move_by_their_jacobians) {
  const Plan plan = compile(with_sites());
  const int sites = static_cast<int>(plan.model().sites.size());
  constexpr int environments = 5;
  Batch<double> batch = scattered<double>(plan, environments);
  batch.step(2);
  const Array<double> poses = answer(batch, {{Quantity::site_pose}}),
                      places = answer(batch, {{Quantity::site_position}}),
                      velocities = answer(batch, {{Quantity::site_velocity}});
  for (int s = 0; s < sites; ++s) {
    const Site& site = plan.model().sites[static_cast<std::size_t>(s)];
    const auto link = batch.link_poses(plan.link(site.link)), jacobian = batch.site_jacobians(s);
    EXPECT_TRUE((poses.middleRows(7 * s, 3) == places.middleRows(3 * s, 3)).all());
    for (int e = 0; e < environments; ++e) {
      const Eigen::Quaterniond of_link(link(3, e), link(4, e), link(5, e), link(6, e));
      const Eigen::Quaterniond turn(poses(7 * s + 3, e), poses(7 * s + 4, e), poses(7 * s + 5, e), poses(7 * s + 6, e));
      const Eigen::Matrix3d right = of_link.toRotationMatrix() * site.pose.linear();
      EXPECT_LE((turn.toRotationMatrix() - right).norm(), 1e-14);
      Eigen::VectorXd v(plan.dofs() + 6);
      v << batch.root_velocities().col(e).matrix(), batch.velocities().col(e).matrix();
      for (int k = 0; k < 6; ++k) {
        double speed = 0.0;
        for (int c = 0; c < v.size(); ++c) speed += jacobian(6 * c + k, e) * v[c];
        EXPECT_NEAR(velocities(6 * s + k, e), speed, 1e-12 * (1.0 + std::abs(speed)));
      }
    }
  }
}

TEST(Read, shows_targets_of_all_stage_times) {
  const Plan plan = compile(scenes::chain8(), {.integrator = Integrator::leapfrog, .stage_inputs = true});
  Batch<float> batch = scattered<float>(plan, 3);
  ASSERT_GT(batch.position_targets().rows(), plan.dofs());
  EXPECT_TRUE((answer(batch, {{Quantity::position_target}}) == batch.position_targets()).all());
}

TEST(Read, refuses_elements_scales_and_memory_that_are_none_and_writes_nothing) {
  const Plan plan = compile(with_sites());
  Batch<float> batch(plan, 2, {.threads = 1});
  std::vector<float> memory(500, Memory<float>::unwritten);
  const auto refused = [&](const Query& query, const char* words) {
    const Query queries[] = {{Quantity::position}, query};
    try {
      batch.read(queries, {memory.data(), 2, 1});
      ADD_FAILURE() << "accepted";
    } catch (const UsageError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
    EXPECT_EQ(memory[0], Memory<float>::unwritten);
    EXPECT_THROW(plan.query_rows(query), UsageError);
  };
  refused({Quantity::link_pose, {99}}, "element 99 of query link_pose");
  refused({Quantity::position, {-1}}, "element -1 of query position");
  refused({Quantity::site_position, {0, 3}}, "element 3 of query site_position");
  refused({Quantity::root_velocity, {1}}, "give 0 to 0");
  refused({Quantity::kinetic_energy, {1}}, "element 1");
  refused({Quantity(static_cast<int>(Quantity::height_scan) + 1)}, "none of the enumerators");
  refused({Quantity(-1)}, "none of the enumerators");
  refused({Quantity::position, {}, std::nan("")}, "give a finite number");
  const Query positions[] = {{Quantity::position}};
  EXPECT_THROW(batch.read(positions, {}), UsageError);
  EXPECT_NO_THROW(batch.read({}, {}));
}

}  // namespace
}  // namespace lockstep
