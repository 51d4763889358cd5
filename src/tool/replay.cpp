// SPDX-License-Identifier: Apache-2.0
#include "replay.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "state.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

using namespace view;

// Where the column stands in the table; an error where it does not.
std::size_t column_of(const Table& table, const std::string& name) {
  const auto found = std::find(table.columns.begin(), table.columns.end(), name);
  if (found == table.columns.end())
    throw InputError(
        fmt::format("{}:1: there is no column '{}'; give a file that `lockstep simulate --record` wrote of "
                    "this model with the same --fixed-base or --floating-base",
                    table.file, name));
  return static_cast<std::size_t>(found - table.columns.begin());
}

// The table with these of its columns.
Table picked(const Table& table, const std::vector<std::size_t>& columns) {
  Table result{.file = table.file, .columns = {}, .rows = {}, .lines = table.lines};
  for (const std::size_t column : columns) result.columns.push_back(table.columns[column]);
  for (const std::vector<double>& row : table.rows) {
    result.rows.emplace_back();
    for (const std::size_t column : columns) result.rows.back().push_back(row[column]);
  }
  return result;
}

Fault fault_of(const Table& table, std::size_t row, std::size_t column) {
  const double number = table.rows[row][column];
  for (auto fault = static_cast<unsigned>(Fault::none); fault <= static_cast<unsigned>(Fault::bad_input); ++fault)
    if (number == fault) return static_cast<Fault>(fault);
  throw InputError(fmt::format("{}: {} is the number of no fault", table.at(row, column), number));
}

void require_known_columns(const Table& table, const std::vector<StateColumn>& states) {
  std::set<std::string> known = {"time", "fault"};
  for (const StateColumn& state : states) known.insert(state.name);
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const std::string& name = table.columns[i];
    if (known.count(name) == 0 && !name.starts_with("C.") && !name.starts_with("site."))
      throw InputError(
          fmt::format("{}:1:{}: unknown column '{}'; give a file that `lockstep simulate --record` wrote of "
                      "this model",
                      table.file, i + 1, name));
  }
}

}  // namespace

Recording recording_of(Table table, const Plan& plan) {
  const std::vector<StateColumn> states = state_columns(plan, true);
  require_known_columns(table, states);
  const std::size_t time = column_of(table, "time"), fault = column_of(table, "fault");
  Recording recording;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const double at = table.rows[row][time];
    if (row > 0 && !(at > recording.times.back()))
      throw InputError(fmt::format("{}: the time {} s is not after {} s, that of the line before", table.at(row, time),
                                   at, recording.times.back()));
    recording.times.push_back(at);
    if (const Fault found = fault_of(table, row, fault); found != Fault::none && !recording.frozen)
      recording.frozen = {at, found};
  }
  std::vector<std::size_t> columns;
  for (const StateColumn& state : states) columns.push_back(column_of(table, state.name));
  recording.states = picked(table, columns);
  return recording;
}

Motion replay(const std::vector<Recording>& recordings, const Plan& plan, const std::vector<VisualMesh>& meshes,
              double rate, int threads) {
  const std::vector<double>& times = recordings.front().times;
  for (const Recording& recording : recordings)
    if (recording.times != times)
      throw InputError(fmt::format("{} and {} have different times; record both with the same --dt and --seconds",
                                   recordings.front().states.file, recording.states.file));
  const double dt = times.size() > 1 ? (times.back() - times.front()) / static_cast<double>(times.size() - 1) : 1.0;
  const auto interval = static_cast<std::size_t>(sampling_interval(rate, dt));
  std::vector<std::size_t> kept;
  for (std::size_t row = 0; row < times.size(); ++row)
    if (row % interval == 0 || row + 1 == times.size()) kept.push_back(row);
  std::vector<double> at;
  for (const std::size_t row : kept) at.push_back(times[row]);
  std::vector<std::string> labels;
  for (const Recording& recording : recordings) labels.push_back(recording.states.file);

  Motion motion(plan, false, std::move(labels), meshes);
  motion.require_room(kept.size());
  Batch<double> states(plan, static_cast<int>(kept.size()), {.threads = threads});  // an environment for each sample
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    Table table{recordings[i].states.file, recordings[i].states.columns, {}, {}};
    for (const std::size_t row : kept) {
      table.rows.push_back(recordings[i].states.rows[row]);
      table.lines.push_back(recordings[i].states.lines[row]);
    }
    apply_state(table, states);
    motion.add(at, states, static_cast<int>(i));
    if (recordings[i].frozen) motion.tracks[i].frozen = {*recordings[i].frozen};
  }
  return motion;
}

}  // namespace lockstep::tool
