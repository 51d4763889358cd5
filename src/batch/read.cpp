// Batch::read(): what an observation is made of, in one kinematics pass. SPDX-License-Identifier: Apache-2.0
#include "impl.h"
#include "plan/query.h"

namespace lockstep {
namespace {

bool is_of_sites(Quantity quantity) {
  switch (quantity) {
    case Quantity::site_pose:
    case Quantity::site_position:
    case Quantity::site_velocity:
    case Quantity::site_twist:
    case Quantity::site_gravity:
    case Quantity::site_acceleration: return true;
    default: return false;
  }
}

bool is_of_frames(Quantity quantity) {
  switch (quantity) {
    case Quantity::link_pose:
    case Quantity::link_velocity:
    case Quantity::link_twist:
    case Quantity::link_gravity:
    case Quantity::link_acceleration:
    case Quantity::joint_wrench:
    case Quantity::height_scan: return true;
    default: return is_of_sites(quantity);
  }
}

bool is_of_accelerations(Quantity quantity) {
  return quantity == Quantity::link_acceleration || quantity == Quantity::site_acceleration ||
         quantity == Quantity::joint_wrench;
}

bool is_of_contacts(Quantity quantity) {
  return (quantity >= Quantity::contact_force && quantity <= Quantity::unfinished_contacts) ||
         quantity == Quantity::link_contact_force || quantity == Quantity::link_contacts;
}

template <class Act>
void for_each_element(const Query& query, int elements, const Act& act) {
  if (query.elements.empty())
    for (int i = 0; i < elements; ++i) act(i);
  else
    for (const int i : query.elements) act(i);
}

}  // namespace

/// Writes the answers of one tile.
template <class S>
class Batch<S>::Impl::TileReader {
 public:
  TileReader(Impl& batch, const StridedRows<S>& out, std::ptrdiff_t first, int count, bool reads_contacts,
             bool reads_accelerations, S* numbers, void* scratch)
      : batch_(batch),
        out_(out),
        first_(first),
        lanes_(batch.kernels.lanes),
        count_(std::min<std::ptrdiff_t>(lanes_, count - first)),
        tile_(kernels::at(batch.tables, batch.state_pointers(), first)),
        frames_(numbers),
        accelerations_(numbers + kernels::frame_numbers * lanes_ * static_cast<std::ptrdiff_t>(batch.wanted.size())),
        contacts_(accelerations_ + (reads_accelerations ? kernels::acceleration_numbers : 0) * lanes_ *
                                       static_cast<std::ptrdiff_t>(batch.wanted.size())),
        numbers_(contacts_ + (kernels::contact_numbers * batch.tables.contacts.slots + 1) * lanes_),
        scratch_(scratch) {
    if (!batch.wanted.empty())
      batch.kernels.read_frames(batch.tables, tile_, 0, batch.wanted.data(), static_cast<int>(batch.wanted.size()),
                                numbers, scratch);
    if (reads_accelerations && !batch.wanted.empty())
      batch.kernels.read_accelerations(batch.tables, tile_, 0, batch.wanted.data(),
                                       static_cast<int>(batch.wanted.size()), accelerations_, scratch);
    if (reads_contacts && batch.tables.contacts.used())
      batch.kernels.read_contacts(batch.tables, tile_, 0, contacts_, scratch);
  }

  void answer(const Query& query) {
    scale_ = static_cast<S>(query.scale);
    const int elements = shape_of(program_of(batch_.plan), query.quantity).elements;
    switch (query.quantity) {
      case Quantity::position: return copy(query, elements, tile_.position, 1);
      case Quantity::velocity: return copy(query, elements, tile_.velocity, 1);
      case Quantity::position_target: return copy(query, elements, tile_.position_target, 1);
      case Quantity::velocity_target: return copy(query, elements, tile_.velocity_target, 1);
      case Quantity::effort: return copy(query, elements, tile_.effort, 1);
      case Quantity::root_pose: return copy(query, elements, tile_.root_pose, 7);
      case Quantity::root_velocity: return copy(query, elements, tile_.root_velocity, 6);
      case Quantity::solve_counts: return copy(query, elements, tile_.solve_counts, solve_count_rows);
      case Quantity::loop_force: return copy(query, elements, tile_.loop_force, 6);
      case Quantity::drive_effort: return copy_part(query, elements, tile_.drive_effort, drive_effort_rows, 0);
      case Quantity::drive_effort_peak: return copy_part(query, elements, tile_.drive_effort, drive_effort_rows, 1);
      case Quantity::drive_effort_mean: return copy_part(query, elements, tile_.drive_effort, drive_effort_rows, 2);
      case Quantity::contact_time: return copy_times(query, elements, 0);
      case Quantity::contact_air_time: return copy_times(query, elements, 1);
      case Quantity::contact_last_time: return copy_times(query, elements, 2);
      case Quantity::contact_last_air_time: return copy_times(query, elements, 3);
      case Quantity::contact_first_touch: return copy_history(query, elements, 4);
      case Quantity::contact_peak_force: return copy_history(query, elements, 5);
      case Quantity::contact_mean_force: return copy_mean_forces(query, elements);
      case Quantity::joint_acceleration: return copy(query, elements, tile_.acceleration, 1);
      case Quantity::coupling_error: return compute(query, elements, kernels::Quantity::coupling_errors, 1);
      case Quantity::loop_error: return answer_loop_errors(query, elements);
      case Quantity::kinetic_energy: return compute(query, elements, kernels::Quantity::kinetic_energy, 1);
      case Quantity::potential_energy: return compute(query, elements, kernels::Quantity::potential_energy, 1);
      default: break;
    }
    if (is_of_contacts(query.quantity)) return answer_contacts(query, elements);
    for_each_element(query, elements, [&](int i) {
      const bool of_site = is_of_sites(query.quantity);
      const Pose* const pose = of_site ? &batch_.plan.model().sites[i].pose : nullptr;
      const int frame = batch_.frame_of(query.quantity, i);
      if (frame < 0) return put_zeros(6);
      const S* const numbers = frames_ + kernels::frame_numbers * lanes_ * batch_.slot[frame];
      const S* const turn = numbers + 3 * lanes_;
      const S* const velocity = numbers + 12 * lanes_;
      switch (query.quantity) {
        case Quantity::link_velocity:
        case Quantity::site_velocity: return put(velocity, 6, lanes_);
        case Quantity::link_twist:
        case Quantity::site_twist: return put_pair_in_frame(turn, pose, velocity);
        case Quantity::link_acceleration:
        case Quantity::site_acceleration: return put_pair_in_frame(turn, pose, acceleration(frame));
        case Quantity::joint_wrench: return put_pair_in_frame(turn, pose, acceleration(frame) + 6 * lanes_);
        case Quantity::height_scan: return scan_heights(query, numbers);
        case Quantity::link_gravity:
        case Quantity::site_gravity:
          return put_in_frame(turn, pose, [&](int k, std::ptrdiff_t lane) { return down(lane)[k]; });
        case Quantity::site_position: return put(numbers, 3, lanes_);
        default: break;
      }
      put(numbers, 3, lanes_);
      put_turn(turn, pose);
    });
  }

 private:
  using Vector = Eigen::Matrix<S, 3, 1>;

  void put(const S* numbers, int rows, std::ptrdiff_t stride) {
    for (int k = 0; k < rows; ++k, ++row_)
      for (std::ptrdiff_t lane = 0; lane < count_; ++lane) at(row_, lane) = scale_ * numbers[k * stride + lane];
  }

  S& at(int row, std::ptrdiff_t lane) const {
    return out_.data[row * out_.row_stride + (first_ + lane) * out_.environment_stride];
  }

  void copy(const Query& query, int elements, const S* rows, int rows_of_each) {
    for_each_element(query, elements,
                     [&](int i) { put(rows + rows_of_each * i * batch_.stride, rows_of_each, batch_.stride); });
  }

  // Row `part` of each element's.
  void copy_part(const Query& query, int elements, const S* rows, int rows_of_each, int part) {
    for_each_element(query, elements,
                     [&](int i) { put(rows + (rows_of_each * i + part) * batch_.stride, 1, batch_.stride); });
  }

  void copy_history(const Query& query, int elements, int part) {
    copy_part(query, elements, tile_.contact_history, contact_history_rows, part);
  }

  // Steps become seconds.
  void copy_times(const Query& query, int elements, int part) {
    scale_ = static_cast<S>(query.scale * batch_.plan.settings().dt);
    copy_history(query, elements, part);
  }

  // On the collider that users name second.
  void copy_mean_forces(const Query& query, int elements) {
    const S scale = scale_;
    for_each_element(query, elements, [&](int i) {
      scale_ = program_of(batch_.plan).contacts.pairs[static_cast<std::size_t>(i)].swapped ? -scale : scale;
      put(tile_.contact_history + (contact_history_rows * i + 6) * batch_.stride, 3, batch_.stride);
    });
  }

  // Number k of a slot. Normals are from the pair's first collider as users name it.
  S contact(int slot, int k, std::ptrdiff_t lane) const {
    return contacts_[(slot * kernels::contact_numbers + k) * lanes_ + lane];
  }

  void answer_contacts(const Query& query, int elements) {
    const auto put_row = [&](const auto& number_in) {
      for (std::ptrdiff_t lane = 0; lane < count_; ++lane) at(row_, lane) = scale_ * number_in(lane);
      ++row_;
    };

    // One number of each environment.
    if (query.quantity == Quantity::unfinished_contacts)
      return put_row([&](std::ptrdiff_t lane) {
        const int row = batch_.tables.contacts.slots * kernels::contact_numbers;
        return batch_.tables.contacts.used() ? contacts_[row * lanes_ + lane] : S(0);
      });

    // Sums over the pairs of a link.
    if (query.quantity == Quantity::link_contacts)
      return for_each_element(query, elements, [&](int link) {
        put_row([&](std::ptrdiff_t lane) {
          S bearing = 0;
          for (const auto& [pair, sign] : batch_.pairs_of_link[static_cast<std::size_t>(link)])
            bearing += normal_force(pair, lane) > S(0) ? S(1) : S(0);
          return bearing;
        });
      });
    if (query.quantity == Quantity::link_contact_force)
      return for_each_element(query, elements, [&](int link) {
        for (int k = 0; k < 3; ++k)
          put_row([&](std::ptrdiff_t lane) {
            S sum = 0;
            for (const auto& [pair, sign] : batch_.pairs_of_link[static_cast<std::size_t>(link)])
              sum += static_cast<S>(sign) * force(pair, k, lane);
            return sum;
          });
      });

    for_each_element(query, elements, [&](int i) {
      const bool by_slot = query.quantity == Quantity::contact_point;
      const int pair = by_slot ? pair_of_slot(i) : i;

      // All numbers of a slot. Normal and force are seen from the collider that users name first.
      if (by_slot) {
        const S sign = sign_of(pair);
        for (int k = 0; k < kernels::contact_numbers; ++k)
          put_row([&](std::ptrdiff_t lane) { return (k >= 3 && k < 9 ? sign : S(1)) * contact(i, k, lane); });
        return;
      }

      switch (query.quantity) {
        case Quantity::contact_normal_force:
          return put_row([&](std::ptrdiff_t lane) { return normal_force(pair, lane); });
        case Quantity::contact_gap:
          return put_row([&](std::ptrdiff_t lane) {
            return over_slots(pair, std::numeric_limits<S>::infinity(),
                              [&](S least, int slot) { return std::min(least, contact(slot, 9, lane)); });
          });
        case Quantity::contact_slip:
          return put_row([&](std::ptrdiff_t lane) {
            return over_slots(pair, S(0), [&](S most, int slot) {
              return normal_force_at(slot, lane) > S(0) ? std::max(most, contact(slot, 10, lane)) : most;
            });
          });
        default: break;
      }

      // The force, as a vector.
      for (int k = 0; k < 3; ++k) put_row([&](std::ptrdiff_t lane) { return force(pair, k, lane); });
    });
  }

  // A sum or an extreme over the slots of a pair.
  S over_slots(int pair, S result, const auto& take) const {
    const PlanContact& own = program_of(batch_.plan).plan_contacts[static_cast<std::size_t>(pair)];
    for (int slot = own.first_slot; slot < own.first_slot + own.slots; ++slot) result = take(result, slot);
    return result;
  }

  S normal_force_at(int slot, std::ptrdiff_t lane) const {
    S sum = 0;
    for (int k = 0; k < 3; ++k) sum += contact(slot, 3 + k, lane) * contact(slot, 6 + k, lane);
    return sum;
  }

  S normal_force(int pair, std::ptrdiff_t lane) const {
    return over_slots(pair, S(0), [&](S sum, int slot) { return sum + normal_force_at(slot, lane); });
  }

  // Component k of the force on the collider that users name second.
  S force(int pair, int k, std::ptrdiff_t lane) const {
    const S sign = sign_of(pair);
    return over_slots(pair, S(0), [&](S sum, int slot) { return sum + sign * contact(slot, 6 + k, lane); });
  }

  S sign_of(int pair) const {
    return program_of(batch_.plan).contacts.pairs[static_cast<std::size_t>(pair)].swapped ? S(-1) : S(1);
  }

  int pair_of_slot(int slot) const {
    const auto& all = program_of(batch_.plan).plan_contacts;
    int pair = 0;
    while (slot >= all[static_cast<std::size_t>(pair)].first_slot + all[static_cast<std::size_t>(pair)].slots) ++pair;
    return pair;
  }

  void compute(const Query& query, int elements, kernels::Quantity quantity, int rows_of_each) {
    batch_.kernels.read(batch_.tables, tile_, 0, lanes_, {quantity}, numbers_, lanes_, scratch_);
    for_each_element(query, elements, [&](int i) { put(numbers_ + rows_of_each * i * lanes_, rows_of_each, lanes_); });
  }

  void answer_loop_errors(const Query& query, int elements) {
    batch_.kernels.read(batch_.tables, tile_, 0, lanes_, {kernels::Quantity::loop_errors}, numbers_, lanes_, scratch_);
    for (int l = 0; l < elements; ++l) {
      S* const angles = numbers_ + (2 * l + 1) * lanes_;
      std::transform(angles, angles + lanes_, angles, &angle_of_gap<S>);
    }
    for_each_element(query, elements, [&](int i) { put(numbers_ + 2 * i * lanes_, 2, lanes_); });
  }

  void scan_heights(const Query& query, const S* frame) {
    constexpr std::size_t at_once = 32;
    constexpr std::ptrdiff_t most_lanes = 16;
    S points[2 * at_once];
    alignas(most_lanes * sizeof(double)) S numbers[at_once * most_lanes];  // kernels store whole registers
    for (std::size_t i = 0; i < query.points.size(); i += at_once) {
      const std::size_t count = std::min(at_once, query.points.size() - i);
      for (std::size_t k = 0; k < 2 * count; ++k) points[k] = static_cast<S>(query.points[i + k / 2][k % 2]);
      batch_.kernels.scan_heights(batch_.tables, tile_, frame, points, static_cast<int>(count), numbers, scratch_);
      put(numbers, static_cast<int>(count), lanes_);
    }
  }

  // A rotation, row-major, and that of a pose on it.
  Eigen::Matrix<S, 3, 3> rotation_of(const S* numbers, const Pose* pose, std::ptrdiff_t lane) const {
    Eigen::Matrix<S, 3, 3> rotation;
    for (int k = 0; k < 9; ++k) rotation(k / 3, k % 3) = numbers[k * lanes_ + lane];
    return pose ? (rotation * pose->linear().template cast<S>()).eval() : rotation;
  }

  // Its quaternion.
  void put_turn(const S* numbers, const Pose* pose) {
    for (std::ptrdiff_t lane = 0; lane < count_; ++lane) {
      const Eigen::Matrix<S, 4, 1> turn = quaternion_of(rotation_of(numbers, pose, lane));
      for (int k = 0; k < 4; ++k) at(row_ + k, lane) = scale_ * turn[k];
    }
    row_ += 4;
  }

  const S* acceleration(int frame) const {
    return accelerations_ + kernels::acceleration_numbers * lanes_ * batch_.slot[frame];
  }

  void put_zeros(int rows) {
    for (const int end = row_ + rows; row_ < end; ++row_)
      for (std::ptrdiff_t lane = 0; lane < count_; ++lane) at(row_, lane) = S(0);
  }

  // Two vectors of the world, along the axes of such a frame.
  void put_pair_in_frame(const S* turn, const Pose* pose, const S* vectors) {
    for (int part = 0; part < 2; ++part)
      put_in_frame(turn, pose, [&](int k, std::ptrdiff_t lane) { return vectors[(3 * part + k) * lanes_ + lane]; });
  }

  // The same of one vector.
  void put_in_frame(const S* numbers, const Pose* pose, const auto& component) {
    for (std::ptrdiff_t lane = 0; lane < count_; ++lane) {
      const Vector vector = {component(0, lane), component(1, lane), component(2, lane)};
      const Vector turned = rotation_of(numbers, pose, lane).transpose() * vector;
      for (int k = 0; k < 3; ++k) at(row_ + k, lane) = scale_ * turned[k];
    }
    row_ += 3;
  }

  // The unit vector along gravity in the world; 0 without gravity.
  Vector down(std::ptrdiff_t lane) const {
    Vector gravity;
    const S* const own = tile_.field(Parameter::gravity);
    for (int k = 0; k < 3; ++k) gravity[k] = own ? own[k * batch_.stride + lane] : batch_.tables.gravity[k];
    return gravity.stableNormalized();
  }

  Impl& batch_;
  const StridedRows<S>& out_;
  std::ptrdiff_t first_, lanes_, count_;
  StatePointers<S> tile_;
  S *frames_, *accelerations_, *contacts_, *numbers_;
  void* scratch_;
  S scale_ = S(1);
  int row_ = 0;
};

// Of element i: its place in `frames`, or -1 if it has none.
template <class S>
int Batch<S>::Impl::frame_of(Quantity quantity, int i) const {
  if (quantity == Quantity::joint_wrench) return moved_link[static_cast<std::size_t>(i)];
  return is_of_sites(quantity) ? tables.links + i : i;
}

template <class S>
void Batch<S>::read(std::span<const Query> queries, const StridedRows<S>& out) const {
  const Alone alone(impl().in_use);
  std::ptrdiff_t rows = 0;
  for (const Query& query : queries) rows += plan().query_rows(query);
  impl().require_foreign(Extent(out.data, {{rows, out.row_stride}, {environments(), out.environment_stride}}),
                         "memory of the queries");
  impl().read(queries, out, environments());
}

// Of the first `count` environments.
template <class S>
void Batch<S>::Impl::read(std::span<const Query> queries, const StridedRows<S>& out, int count) {
  Impl& batch = *this;
  int rows = 0;
  for (const Query& query : queries) rows += batch.plan.query_rows(query);
  if (rows == 0) return;
  if (!out.data) throw UsageError("memory of the queries", "is null", "give " + std::to_string(rows) + " rows");

  // The frames that are asked for, once each.
  batch.wanted.clear();
  std::fill(batch.slot.begin(), batch.slot.end(), -1);
  for (const Query& query : queries)
    if (is_of_frames(query.quantity))
      for_each_element(query, shape_of(program_of(batch.plan), query.quantity).elements, [&](int i) {
        const int frame = batch.frame_of(query.quantity, i);
        if (frame < 0 || batch.slot[frame] >= 0) return;
        batch.slot[frame] = static_cast<int>(batch.wanted.size());
        batch.wanted.push_back(batch.frames[frame]);
      });

  const bool reads_contacts =
      std::any_of(queries.begin(), queries.end(), [](const Query& query) { return is_of_contacts(query.quantity); });
  const bool reads_accelerations = std::any_of(queries.begin(), queries.end(),
                                               [](const Query& query) { return is_of_accelerations(query.quantity); });
  const int lanes = batch.kernels.lanes;
  batch.workers.for_environments(batch.stepped(count), batch.step_nanoseconds, lanes,
                                 [&](std::ptrdiff_t first, std::ptrdiff_t last, void* scratch) {
                                   batch.normalise_roots(first, std::min<std::ptrdiff_t>(last, count));
                                   S* const numbers =
                                       reinterpret_cast<S*>(static_cast<std::byte*>(scratch) + batch.frames_at());
                                   for (; first < last; first += lanes) {
                                     typename Impl::TileReader tile(batch, out, first, count, reads_contacts,
                                                                    reads_accelerations, numbers, scratch);
                                     for (const Query& query : queries) tile.answer(query);
                                   }
                                 });
}

template void Batch<float>::read(std::span<const Query>, const StridedRows<float>&) const;
template void Batch<double>::read(std::span<const Query>, const StridedRows<double>&) const;
template void Batch<float>::Impl::read(std::span<const Query>, const StridedRows<float>&, int);
template void Batch<double>::Impl::read(std::span<const Query>, const StridedRows<double>&, int);

}  // namespace lockstep
