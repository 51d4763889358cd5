// Pages of motions, for lockstep/recording.py and lockstep/rendering.py. SPDX-License-Identifier: Apache-2.0
#include "view/page.h"

#include <pybind11/stl.h>

#include "batch.h"

namespace lockstep::python {
namespace {

using namespace pybind11::literals;

view::Motion motion_of(const Plan& plan, const std::vector<int>& environments) {
  std::vector<std::string> labels;
  for (const int environment : environments) labels.push_back("environment " + std::to_string(environment));
  return {plan, true, std::move(labels)};
}

void add(view::Motion& motion, double time, AnyBatch& batch, const std::vector<int>& environments) {
  batch.use([&](const auto& own) { motion.add(time, own, environments); });
}

py::bytes page_of(const view::Motion& motion, const std::string& about) {
  view::require_viewer();
  return view::page_of(motion, about, view::notes_on(motion));
}

}  // namespace

void bind_view(py::module_& module) {
  py::class_<view::Motion>(module, "_Motion", py::is_final(), "Samples of environments, which a page plays.")
      .def(py::init(&motion_of), "plan"_a, "environments"_a)
      .def("require_room", &view::Motion::require_room, "samples"_a)
      .def("add", &add, "time"_a, "batch"_a, "environments"_a)
      .def_property_readonly("samples", [](const view::Motion& motion) { return motion.times.size(); })
      .def("page", &page_of, "about"_a)
      .def("numbers", &view::motion_numbers);
}

}  // namespace lockstep::python
