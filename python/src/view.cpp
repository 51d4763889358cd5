// Pages of motions, for lockstep/recording.py and lockstep/rendering.py. SPDX-License-Identifier: Apache-2.0
#include "view/page.h"

#include <pybind11/stl.h>

#include "batch.h"

namespace lockstep::python {
namespace {

using namespace pybind11::literals;

// [n, 3] numbers of a mesh as columns.
template <class S>
Eigen::Matrix<S, 3, Eigen::Dynamic> threes(const py::handle& given, const char* what) {
  const auto array = py::array_t<S, py::array::c_style | py::array::forcecast>::ensure(given);
  if (!array || array.ndim() != 2 || array.shape(1) != 3)
    throw UsageError(std::string(what) + " of a visual mesh", "are no array [n, 3]", "give three numbers for each");
  return Eigen::Map<const Eigen::Matrix<S, 3, Eigen::Dynamic>>(array.data(), 3, array.shape(0));
}

VisualMesh mesh_of(const py::handle& mesh) {
  VisualMesh own{value_of<std::string>(mesh.attr("link"), "link"), threes<float>(mesh.attr("vertices"), "vertices"),
                 threes<int>(mesh.attr("triangles"), "triangles")};
  if (own.triangles.size() > 0 &&
      (own.triangles.minCoeff() < 0 || own.triangles.maxCoeff() >= static_cast<int>(own.vertices.cols())))
    throw UsageError("triangles of a visual mesh", "name vertices that it does not have", "count them from 0");
  return own;
}

view::Motion motion_of(const Plan& plan, const std::vector<int>& environments, const py::iterable& visual_meshes) {
  std::vector<std::string> labels;
  for (const int environment : environments) labels.push_back("environment " + std::to_string(environment));
  std::vector<VisualMesh> meshes;
  for (const py::handle mesh : visual_meshes) meshes.push_back(mesh_of(mesh));
  return {plan, true, std::move(labels), meshes};
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
  py::class_<view::Motion> motion(module, "_Motion", py::is_final(), "Samples of environments, which a page plays.");
  forbid_new(motion);
  motion.def_static("of", &motion_of, "plan"_a, "environments"_a, "visual_meshes"_a = py::tuple())
      .def("__reduce__", [](const view::Motion&) -> py::object { throw py::type_error("a motion cannot be copied"); })
      .def("require_room", &view::Motion::require_room, "samples"_a)
      .def("clear", &view::Motion::clear)
      .def("add", &add, "time"_a, "batch"_a, "environments"_a)
      .def_property_readonly("samples", [](const view::Motion& motion) { return motion.times.size(); })
      .def("page", &page_of, "about"_a)
      .def("numbers", &view::motion_numbers);
}

}  // namespace lockstep::python
