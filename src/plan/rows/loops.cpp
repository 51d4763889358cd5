// Loops as rows over the solver's velocities. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <set>

#include "model/loops.h"
#include "plan/layout.h"

namespace lockstep {
namespace {

HeldLoop<double> held_loop(const Program& program, const Loop& loop) {
  HeldLoop<double> held{};
  held.kind = loop.kind;
  held.translations = translations_of(loop.kind), held.rotations = rotations_of(loop.kind);
  Eigen::Isometry3d first(loop.first_pose), second(loop.second_pose), turn = Eigen::Isometry3d::Identity();
  turn.linear() = turn_to_axis(loop);
  const BodyPlace before = place_of(program, loop.first, first * turn),
                  after = place_of(program, loop.second, second * turn),
                  link = place_of(program, loop.first, Eigen::Isometry3d::Identity());
  double none[3];
  held.first = before.body, held.second = after.body;
  put_pose(before.pose, held.first_rotation, held.first_offset);
  put_pose(after.pose, held.second_rotation, held.second_offset);
  put_pose(link.pose, held.link_rotation, held.link_offset);
  put_pose(turn, held.turn, none);
  held.soft = !is_hard(loop.softness);
  held.moves = declared(program, Parameter::loop_frame);
  return held;
}

// The bodies that carry the loops' frames, and all bodies between them and the world.
std::vector<int> carrying_bodies(const Tables<double>& t, const std::vector<HeldLoop<double>>& loops) {
  std::set<int> bodies;
  for (const HeldLoop<double>& loop : loops)
    for (const int end : {loop.first, loop.second})
      for (int body = end; body >= 0; body = t.body[body].parent) bodies.insert(body);
  return {bodies.begin(), bodies.end()};
}

}  // namespace

bool has_loops(const Program& program) { return !program.model.loops.empty(); }

void lay_out_loops(Program& program) {
  Tables<double>& t = program.f64;
  std::vector<HeldLoop<double>> loops;
  std::vector<PairColumn> columns;
  std::vector<ColumnPart> parts;
  const Forms forms(program, t.reduction);
  for (const Loop& from : program.model.loops) {
    HeldLoop<double> loop = held_loop(program, from);
    loop.row = t.loops.rows, loop.value = t.loops.values;
    loop.column = static_cast<int>(columns.size());
    for (const auto& [z, list] : columns_between(program, forms, loop.first, loop.second)) {
      const int first = static_cast<int>(parts.size());
      parts.insert(parts.end(), list.begin(), list.end());
      columns.push_back({z, first, static_cast<int>(parts.size())});
    }
    loop.columns = static_cast<int>(columns.size()) - loop.column;
    t.loops.rows += loop.rows(), t.loops.values += loop.rows() * loop.columns;
    loops.push_back(loop);
  }
  t.loops.bodies = program.storage.keep(carrying_bodies(t, loops));
  t.loops.columns = program.storage.keep(std::move(columns));
  t.loops.parts = program.storage.keep(std::move(parts));
  t.loops.loops = program.storage.keep(std::move(loops));
  lay_out_loop_softness(program);
}

void lay_out_loop_softness(Program& program) {
  Tables<double>& t = program.f64;
  std::vector<HeldLoop<double>> loops(t.loops.loops.data, t.loops.loops.data + t.loops.loops.count);
  for (std::size_t l = 0; l < loops.size(); ++l) {
    const Loop& from = program.model.loops[l];
    const RowSoftness<double> softness = row_softness(program, from.softness, program.length, 1);
    loops[l].rate = softness.rate, loops[l].cfm = softness.cfm;
    loops[l].cfm_per_response = softness.cfm_per_response;
    loops[l].force = std::min(from.force_limit * program.length, unlimited);
    loops[l].torque = std::min(from.torque_limit * program.length, unlimited);
  }
  t.loops.loops = program.storage.keep(std::move(loops));
}

}  // namespace lockstep
