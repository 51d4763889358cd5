// Machine code against an evaluator of the graph: random graphs, few registers, parts, every order.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "evaluate.h"
#include "jit/allocate.h"
#include "jit/encode.h"
#include "jit/lower.h"
#include "jit/memory.h"
#include "jit/schedule.h"
#include "random_graph.h"
#include "seeds.h"
#include "simd/wide.h"

namespace lockstep::jit {
namespace {

// A tile of memory, as a frame shows it.
template <class T>
struct TileMemory {
  using S = typename T::Scalar;
  static constexpr int masks = 4, rows = 7;
  std::vector<T> block, tile, slots, row;

  explicit TileMemory(std::uint64_t seed, int slot_count = 64)
      : block(random_arrays * random_numbers),
        tile(masks, T(S(0))),
        slots(static_cast<std::size_t>(slot_count)),
        row(rows) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> number(-2.0, 2.0);
    for (std::vector<T>* all : {&block, &row, &slots})
      for (T& each : *all)
        for (int i = 0; i < T::lanes; ++i) each.set_lane(i, static_cast<S>(number(random)));
    typename T::Mask frozen = T::none();
    for (int i = 0; i < T::lanes; ++i) frozen.set_lane(i, random() % 8 == 0);
    tile[0] = T::from_bits(frozen.bits);
  }
  Frame frame() { return {block.data(), slots.data(), tile.data(), nullptr, nullptr}; }
};

// What a called stage does: numbers that later code reads change, and no register keeps its value.
template <class T>
void disturb(const Frame* frame, int stage) {
  T* const numbers = static_cast<T*>(frame->block) +
                     (static_cast<Call>(stage) == Call::hold ? variable_array : out_array) * random_numbers;
  const T failed = *static_cast<const T*>(frame->slots);
  for (int i = 0; i < random_numbers; ++i)
    numbers[i] = fma(numbers[i], T(typename T::Scalar(0.5)), select({bits(failed)}, T(1), T(typename T::Scalar(0.25))));
#ifdef __x86_64__
  __asm__ volatile(
      "vpcmpeqd %%ymm0, %%ymm0, %%ymm0\n\tvmovaps %%ymm0, %%ymm1\n\tvmovaps %%ymm0, %%ymm7\n\t"
      "vmovaps %%ymm0, %%ymm15\n\txor %%eax, %%eax\n\tmov %%rax, %%rcx\n\tmov %%rax, %%r8\n\t"
      "mov %%rax, %%r9\n\tmov %%rax, %%r10\n\tmov %%rax, %%r11" ::
          : "xmm0", "xmm1", "xmm7", "xmm15", "rax", "rcx", "r8", "r9", "r10", "r11");
#endif
}

template <class T>
TilePlaces places_of() {
  TilePlaces places;
  const auto size = static_cast<std::ptrdiff_t>(sizeof(T));
  for (int i = 0; i < random_arrays; ++i) places.first[i] = i * random_numbers * size;
  places.arrays = random_arrays;
  for (int i = 0; i < 4; ++i) places.own[i] = i * size;
  places.bytes = static_cast<int>(size), places.fused = true, places.call = disturb<T>;
  return places;
}

template <class T>
void expect_same(const std::vector<T>& a, const std::vector<T>& b, const char* what) {
  for (std::size_t i = 0; i < a.size(); ++i)
    for (int lane = 0; lane < T::lanes; ++lane) {
      const auto x = bits(a[i])[lane], y = bits(b[i])[lane];
      const bool both_nan = a[i].lane(lane) != a[i].lane(lane) && b[i].lane(lane) != b[i].lane(lane);
      ASSERT_TRUE(x == y || both_nan) << what << " " << i << ", lane " << lane << ": " << a[i].lane(lane) << " and "
                                      << b[i].lane(lane);
    }
}

// One step of `tiles` tiles by machine code and by the evaluator.
template <class T>
void expect_the_bits_of_the_graph(const trace::Graph& graph, const Machine& machine, std::uint64_t seed) {
  const TilePlaces places = places_of<T>();
  Listing listing = lower(graph, places, machine);
  schedule(listing, machine.window);
  const Allocated allocated = allocate(listing, machine);
  const CodeMemory memory(encode(allocated, listing.constants, machine, places.call));
  ASSERT_NE(memory.start(), nullptr) << memory.refusal();
  std::vector<TileMemory<T>> by_code, by_graph;
  std::vector<Frame> frames;
  for (int k = 0; k < machine.tiles; ++k) {
    by_code.emplace_back(seed + static_cast<std::uint64_t>(k), allocated.slots + 1);
    by_graph.push_back(by_code.back());
  }
  for (int k = 0; k < machine.tiles; ++k) {
    for (std::size_t i = 0; i < listing.rows.size(); ++i)
      by_code[k].slots[1 + i] = by_code[k].row[static_cast<std::size_t>(listing.rows[i].number)];
    by_code[k].slots.back() = T(7);
    frames.push_back(by_code[k].frame());
  }
  reinterpret_cast<StepCode::Function>(const_cast<void*>(memory.start()))(frames.data(), frames.data() + frames.size());
  for (int k = 0; k < machine.tiles; ++k) {
    const Frame frame = by_graph[k].frame();
    const auto row = [&](int, int number) { return by_graph[k].row[static_cast<std::size_t>(number)]; };
    Evaluation<T, decltype(row)>(graph, places, frame, row).run();
    expect_same(by_code[k].block, by_graph[k].block, "number");
    expect_same(by_code[k].tile, by_graph[k].tile, "mask");
    EXPECT_EQ(by_code[k].slots.back().lane(0), 7) << "the code writes behind its slots";
    if (testing::Test::HasFailure()) return;
  }
}

template <class S, int bytes>
using Numbers = simd::Wide<S, bytes / static_cast<int>(sizeof(S)), simd::Fused>;

class MachineCode : public testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    if (!__builtin_cpu_supports("avx2")) GTEST_SKIP() << "this machine runs no machine code";
  }
  static void compare(const trace::Graph& graph, Machine machine, std::uint64_t seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed << ", registers " << machine.registers << ", window "
                                    << machine.window << ", parts of " << machine.part);
    const auto both = [&]<class T>(T) {
      machine.scalar_bytes = sizeof(typename T::Scalar), machine.register_bytes = sizeof(T);
      expect_the_bits_of_the_graph<T>(graph, machine, seed);
    };
    both(Numbers<float, 32>()), both(Numbers<double, 32>());
    if (!__builtin_cpu_supports("avx512dq")) return;
    both(Numbers<float, 64>()), both(Numbers<double, 64>());
  }
};

TEST_P(MachineCode, of_a_random_graph_has_the_bits_of_its_evaluation) {
  for (int k = 0; k < seeds_of(20, 1) && !HasFailure(); ++k) {
    const auto seed = static_cast<std::uint64_t>(GetParam() + 20 * k);
    const RandomGraph random(seed, 60 + static_cast<int>(seed) * 7 % 400);
    for (const int registers : {3, 4, 5, 6, 8, 16})
      for (const int part : {1, 7, 60, 100000})
        compare(random.graph, {4, 32, registers, registers % 2 * 9, part == 100000 ? part : 1, part, 1 + part % 3},
                seed);
  }
}

TEST_P(MachineCode, in_any_order_has_the_bits_of_its_evaluation) {
  for (int k = 0; k < seeds_of(20, 1) && !HasFailure(); ++k) {
    const auto seed = static_cast<std::uint64_t>(1000 + GetParam() + 20 * k);
    const RandomGraph random(seed, 300);
    for (const int window : {0, 2, 16, 64, 1000}) compare(random.graph, {4, 32, 16, window, 100000, 1, 1}, seed);
  }
}

INSTANTIATE_TEST_SUITE_P(Random, MachineCode, testing::Range(0, 20));

}  // namespace
}  // namespace lockstep::jit
