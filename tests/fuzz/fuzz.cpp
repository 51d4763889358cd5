// SPDX-License-Identifier: Apache-2.0
#include "fuzz.h"

#include <cstdio>
#include <cstdlib>

namespace lockstep::fuzz {
namespace {

constexpr std::size_t most_links = 16, most_pairs = 60;

// What is exported can be read, or is refused at once.
void take_there_and_back(const Model& model) {
  std::string text;
  if (taken([&] { text = export_mjcf(model).text; })) {
    try {
      import_mjcf(text, "exported MJCF", {.colliders = true});
    } catch (const Error& error) {
      require(false, std::string("exported MJCF cannot be read: ") + error.what() + "\n" + text);
    }
  }
  if (!taken([&] { text = export_urdf(model).text; })) return;
  try {
    import_urdf(text, "exported URDF", {.colliders = true});
  } catch (const Error& error) {
    require(false, std::string("exported URDF cannot be read: ") + error.what() + "\n" + text);
  }
}

}  // namespace

void require(bool holds, const std::string& words) {
  if (holds) return;
  std::fprintf(stderr, "%s\n", words.c_str());
  std::abort();
}

template <class S>
void require_sound(const Batch<S>& batch) {
  const auto is_finite = [](const auto& rows, int e) { return rows.rows() == 0 || rows.col(e).allFinite(); };
  for (int e = 0; e < batch.environments(); ++e) {
    const bool finite = is_finite(batch.positions(), e) && is_finite(batch.velocities(), e);
    require(finite || batch.faults()[static_cast<std::size_t>(e)] != Fault::none, "a good state is not finite");
    batch.explain_fault(e);
  }
}
template void require_sound(const Batch<float>&);
template void require_sound(const Batch<double>&);

void use(const Model& model) {
  if (model.links.size() > most_links || model.colliders.size() > most_links) return;
  taken([&] {
    const Plan plan = compile(model);
    if (model.links.size() % 4 == 0) plan.describe();  // it traces a step, which takes longer than all else
    if (plan.contacts().size() > most_pairs || plan.dofs() > static_cast<int>(2 * most_links)) return;
    Batch<float> batch(plan, 2, {.threads = 1, .engine = Engine::tables});
    batch.step(3);
    require_sound(batch);
    batch.link_poses(0);
    batch.save();
  });
  take_there_and_back(model);
}

}  // namespace lockstep::fuzz
