// What ranks of MPI cost: control steps with actions of rank 0 and readings for it. SPDX-License-Identifier: Apache-2.0
//
//   mpirun -n 2 ranks_bench MODEL --envs 4096 --threads 1
//
// Environments get random actions that differ, and are reset in turn. Rank 0 prints one line of JSON: seconds a control
// step by part, in which ranks wait for each other as they do in use, and what goes through MPI.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <random>

#include "lockstep/import.h"
#include "lockstep/mpi.h"

namespace {

using namespace lockstep;
using Array = Batch<float>::Array;
using Clock = std::chrono::steady_clock;

constexpr int episode = 250;  // control steps

struct Options {
  std::string model;
  int environments = 4096, threads = 1, updates = 100, warm = 20, substeps = 4;
  bool lone = false;
};

void run(const Options& options) {
  const Rank own = mpi::rank_of(MPI_COMM_WORLD);
  ImportOptions import;
  import.colliders = options.model.ends_with(".xml");
  Model model = import_file(options.model, import).model;
  for (Joint& joint : model.joints)
    if (joint.drive.kp == 0.0 && !import.colliders) joint.drive.kp = 20.0, joint.drive.kd = 1.0;
  const Plan plan = compile(model, {.dt = 1.0 / 240, .per_environment = {Parameter::mass}});
  const IdRange ids = ids_of(own, options.environments);
  Batch<float> batch(plan, ids.count, {.threads = options.threads, .seed = 1, .first_id = ids.first});
  batch.randomize(Parameter::mass, {.low = 0.8, .high = 1.2});
  batch.reset_random(EnvironmentSet::all(), {.spread = 0.1});
  const mpi::Ranks ranks(MPI_COMM_WORLD, batch);

  const auto actions = static_cast<Eigen::Index>(plan.driven_dofs().size());
  Array all_actions(actions, own.rank == 0 ? options.environments : 0), own_actions(actions, ids.count);
  const std::vector<Query> queries{Query{Quantity::position}, Query{Quantity::velocity}};
  const Eigen::Index read = plan.query_rows(queries[0]) + plan.query_rows(queries[1]);
  Array readings(read, ids.count), all_readings(read, own.rank == 0 ? options.environments : 0);
  std::mt19937 random(5);

  std::map<std::string, double> seconds;
  Clock::time_point last = Clock::now();
  const auto lap = [&](const char* part) {
    const Clock::time_point now = Clock::now();
    seconds[part] += std::chrono::duration<double>(now - last).count();
    last = now;
  };
  for (int update = 0; update < options.warm + options.updates; ++update) {
    if (update == options.warm) {
      MPI_Barrier(MPI_COMM_WORLD);
      seconds.clear(), last = Clock::now();
    }
    for (Eigen::Index i = 0; i < all_actions.size(); ++i)
      all_actions.data()[i] = static_cast<float>(random()) * 0x1p-31f - 1.0f;
    lap("act");
    if (options.lone)
      own_actions = all_actions;
    else
      ranks.scatter(all_actions, own_actions);
    lap("scatter");
    batch.set_actions({own_actions.data(), own_actions.outerStride()});
    batch.step(options.substeps);
    std::vector<int> over;
    for (int e = 0; e < ids.count; ++e)
      if ((batch.ids()[e] + static_cast<unsigned>(update)) % episode == 0 || batch.faults()[e] != Fault::none)
        over.push_back(e);
    batch.reset_random(over, {.spread = 0.1});
    batch.read(queries, {readings.data(), readings.outerStride()});
    lap("step");
    if (options.lone)
      all_readings = readings;
    else
      ranks.gather(readings, all_readings);
    lap("gather");
  }

  // The slowest rank's.
  std::vector<double> parts;
  for (const auto& [part, time] : seconds) parts.push_back(time / options.updates);
  MPI_Allreduce(MPI_IN_PLACE, parts.data(), static_cast<int>(parts.size()), MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
  if (own.rank != 0) return;
  nlohmann::ordered_json json = {{"ranks", own.ranks},
                                 {"threads", batch.threads()},
                                 {"environments", options.environments},
                                 {"actions", actions},
                                 {"readings", read}};
  double sum = 0.0;  // of rank 0, which is where the time is counted
  for (const auto& [part, time] : seconds) sum += time / options.updates;
  json["seconds"] = sum;
  std::size_t i = 0;
  for (const auto& [part, time] : seconds) json[part] = parts[i++];
  const std::int64_t others = options.environments - ids.count;
  json["bytes"] = options.lone ? 0 : 4 * others * (actions + read);
  json["messages"] = options.lone ? 0 : 2 * (own.ranks - 1);
  std::puts(json.dump().c_str());
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  Options options;
  CLI::App app("Control steps of ranks of MPI.", "ranks_bench");
  app.add_option("model", options.model)->required();
  app.add_option("--envs", options.environments, "Of all ranks");
  app.add_option("--threads", options.threads, "Of each rank");
  app.add_option("--updates", options.updates, "Control steps that are measured");
  app.add_flag("--lone", options.lone, "One rank that uses no MPI in its control steps");
  int code = 0;
  try {
    app.parse(argc, argv);
    run(options);
  } catch (const CLI::ParseError& error) {
    code = app.exit(error);
  } catch (const std::exception& error) {
    fmt::print(stderr, "ranks_bench: {}\n", error.what());
    MPI_Abort(MPI_COMM_WORLD, 2);
  }
  MPI_Finalize();
  return code;
}
