// Two threads in one batch are found out. SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <chrono>
#include <functional>
#include <thread>

#include "contract.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

constexpr const char* rule = "the functions of one Batch must not run at the same time";

// From two threads. Returns how many calls were let through.
int step_twice(Batch<float>& batch, int calls) {
  std::atomic<int> ready = 0, let_through = 0;
  const auto step = [&] {
    for (++ready; ready < 2;) std::this_thread::yield();
    for (int i = 0; i < calls; ++i) let_through += batch.step();
  };
  std::thread other(step);
  step();
  other.join();
  return let_through;
}

using Clock = std::chrono::steady_clock;

// Another thread steps all the time while this one calls. What it calls would change nothing, so the batch must have
// moved as one that was stepped alone.
TEST(InUse, refuses_every_function_beside_a_step) {
  const Plan plan = compile(scenes::chain8());
  Batch<float> batch = contract::scattered<float>(plan, 512), alone = contract::scattered<float>(plan, 512);
  Batch<float>::Array frame(7 * static_cast<Eigen::Index>(plan.model().links.size()), 512);
  const std::vector<Query> poses = {{Quantity::link_pose}};
  const std::vector<int> none;
  const std::unique_ptr<bool[]> mask(new bool[512]());
  const Batch<float>::Array empty(8, 0);
  const std::vector<std::byte> blob = batch.save(none);
  const std::vector<std::function<void()>> calls = {
      [&] { batch.reset(none); },
      [&] { batch.reset(std::span<const bool>(mask.get(), 512)); },
      [&] { batch.reset(none, empty, empty); },
      [&] { batch.project(none); },
      [&] { batch.project(std::span<const bool>(mask.get(), 512)); },
      [&] { batch.project(none, Couplings::none); },
      [&] { batch.save(none); },
      [&] { batch.restore(blob, none); },
      [&] { batch.coupling_errors(); },
      [&] { batch.link_poses(2); },
      [&] {
        batch.read(poses, {frame.data(), frame.outerStride()});
      },
      [&] {
        batch.draw({frame.data(), frame.outerStride()}, 2, 0, none);
      },
      [&] { batch.reset_random(none); },
      [&] {
        batch.set_actions({frame.data(), frame.outerStride()}, {.kind = ActionKind::position}, none);
      },
      [&] { batch.check(none); }};
  std::atomic<int> steps = 0;
  std::atomic<bool> stop = false;
  std::thread stepper([&] {
    for (; !stop; ++steps) batch.step(20);
  });
  const Clock::time_point deadline = Clock::now() + std::chrono::seconds(60);
  for (std::size_t i = 0; i < calls.size(); ++i) {
    std::string refused;
    while (refused.empty() && Clock::now() < deadline) try {
        calls[i]();
      } catch (const UsageError& error) {
        refused = error.what();
      }
    EXPECT_NE(refused.find(rule), std::string::npos) << "call " << i << ": " << refused;
  }
  stop = true;
  stepper.join();
  // A step that found one of these calls in the batch did nothing.
  EXPECT_LE(batch.steps()[0], 20u * static_cast<unsigned>(steps));
  EXPECT_EQ(batch.steps()[0] % 20, 0u);
  alone.step(static_cast<int>(batch.steps()[0]));
  EXPECT_TRUE(contract::same_bits(batch, alone));
  for (const auto& call : calls) EXPECT_NO_THROW(call());
}

TEST(InUse, lets_one_of_two_steps_through) {
  const Plan plan = compile(scenes::chain8());
  Batch<float> batch = contract::scattered<float>(plan, 512), alone = contract::scattered<float>(plan, 512);
  constexpr int calls = 2000;  // of which many must meet
  const int let_through = step_twice(batch, calls), taken = static_cast<int>(batch.steps()[0]);
  EXPECT_EQ(taken, let_through);
  EXPECT_LT(taken, 2 * calls);
  EXPECT_GT(taken, 0);
  for (const std::uint32_t count : batch.steps()) EXPECT_EQ(count, static_cast<std::uint32_t>(taken));
  alone.step(taken);
  EXPECT_TRUE(contract::same_bits(batch, alone));
}

// Another thread steps whenever it may. Once a search has begun, it may not.
TEST(InUse, holds_for_all_of_inverse_kinematics) {
  Model model = scenes::chain8();
  model.sites.push_back({"tip", model.links.back().name, Pose::Identity()});
  const Plan plan = compile(model);
  Batch<double> batch(plan, 64, {.threads = 1});
  const Batch<double>::Array targets = Batch<double>::Array::Constant(3, 64, 0.2);
  std::atomic<int> refused = 0;
  std::atomic<bool> stop = false;
  std::thread stepper([&] {
    for (; !stop; std::this_thread::yield()) refused += !batch.step();
  });
  const Clock::time_point deadline = Clock::now() + std::chrono::seconds(20);
  bool done = false;
  while (!(done && refused > 0) && Clock::now() < deadline) {
    try {
      batch.inverse_kinematics(0, targets);
      done = true;
    } catch (const UsageError& error) {
      EXPECT_EQ(error.rule().find(rule) != std::string::npos, true) << error.what();
    }
  }
  stop = true;
  stepper.join();
  EXPECT_TRUE(done);
  EXPECT_GT(refused, 0);
}

}  // namespace
}  // namespace lockstep
