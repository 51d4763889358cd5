// Random numbers that differ from step to step, for Python (M143). SPDX-License-Identifier: Apache-2.0
#include "batch.h"

namespace lockstep::python {
namespace {

std::uint64_t mixed(std::uint64_t x) {  // the finaliser of SplitMix64
  x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
  x = (x ^ x >> 27) * 0x94d049bb133111ebu;
  return x ^ x >> 31;
}

constexpr std::uint64_t golden = 0x9e3779b97f4a7c15u;

template <class T>
void fill(AnyBatch& batch, const py::array_t<T>& out, std::uint64_t stream) {
  py::array_t<T> written = out;
  auto number = written.template mutable_unchecked<2>();
  batch.use([&](const auto& own) {
    if (number.shape(1) != own.environments())
      throw UsageError("out", "has " + std::to_string(number.shape(1)) + " columns",
                       "give one for each of " + std::to_string(own.environments()) + " environments");
    const py::ssize_t rows = number.shape(0);
    for (int e = 0; e < own.environments(); ++e) {
      const auto at = static_cast<std::size_t>(e);
      std::uint64_t x = mixed(own.seeds()[at] + golden);
      for (const std::uint64_t part : {std::uint64_t{own.ids()[at]}, static_cast<std::uint64_t>(own.resets()[at]),
                                       std::uint64_t{own.steps()[at]}, stream})
        x = mixed(x + golden + part);
      for (py::ssize_t row = 0; row < rows; row += 2) {
        const std::uint64_t word = mixed(x + golden * static_cast<std::uint64_t>(row / 2 + 1));
        number(row, e) = static_cast<T>(word >> 8 & 0xffffffu) * T{0x1p-24};
        if (row + 1 < rows) number(row + 1, e) = static_cast<T>(word >> 40) * T{0x1p-24};
      }
    }
  });
}

}  // namespace

void bind_step_draws(py::module_& module) {
  constexpr const char* help = "see lockstep.draws.uniform";
  module.def("_uniform_by_step", &fill<float>, py::arg("batch"), py::arg("out").noconvert(), py::arg("stream"), help);
  module.def("_uniform_by_step", &fill<double>, py::arg("batch"), py::arg("out").noconvert(), py::arg("stream"), help);
}

}  // namespace lockstep::python
