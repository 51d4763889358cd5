// Models from files and to them. SPDX-License-Identifier: Apache-2.0
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cerrno>
#include <filesystem>

#include "batch.h"

namespace lockstep::python {
namespace {

using namespace pybind11::literals;

using FromFile = Import (*)(const std::string&, const ImportOptions&);
using FromText = Import (*)(const std::string&, const std::string&, const ImportOptions&);

py::object imported(const Import& import) {
  py::object model = to_python(import.model);
  model.attr("report") = import.report;
  model.attr("warnings") = import.warnings;
  for (const auto& [link, vertices, triangles] : import.visual_meshes)
    model.attr("visual_meshes")
        .attr("append")(
            py::module_::import("lockstep.model")
                .attr("VisualMesh")(link, py::array_t<float>({vertices.cols(), vertices.rows()}, vertices.data()),
                                    py::array_t<int>({triangles.cols(), triangles.rows()}, triangles.data())));
  return model;
}

// Adds a function of `first` and all options. `read(first..., options)` gives the Import.
template <class... First, class Read, class... Arguments>
void add(py::module_& module, const char* name, const char* help, Read read, const Arguments&... arguments) {
  const ImportOptions o;
  module.def(
      name,
      [read](First... first, double least_mass, double least_inertia, double density, bool repair_inertias,
             bool leave_out_foreign, bool colliders, const std::string& keyframe, const std::string& body,
             const std::string& loops, const std::string& soft, bool leave_out_meshes, bool self_collisions,
             int hull_vertices, const std::string& fit, const std::map<std::string, std::string>& fit_of_links,
             const std::map<std::string, std::filesystem::path>& packages,
             const std::vector<std::filesystem::path>& file_roots, bool visual_meshes, const py::object& ignore) {
        ImportOptions options;
        options.least_mass = least_mass, options.least_inertia = least_inertia, options.density = density;
        options.repair_inertias = repair_inertias, options.leave_out_foreign = leave_out_foreign;
        options.colliders = colliders, options.keyframe = keyframe, options.body = body;
        options.loops = loops_of(loops);
        options.soft = soft_of(soft);
        options.self_collisions = self_collisions;
        options.leave_out_meshes = leave_out_meshes, options.hull_vertices = hull_vertices;
        options.fit = fit_of(fit);
        for (const auto& [link, own] : fit_of_links) options.fit_of_links[link] = fit_of(own);
        for (const auto& [package, folder] : packages) options.packages[package] = folder.string();
        for (const std::filesystem::path& root : file_roots) options.file_roots.push_back(root.string());
        options.visual_meshes = visual_meshes;
        options.ignore = ignored_of(ignore);
        return imported(read(first..., options));
      },
      arguments..., py::kw_only(), "least_mass"_a = o.least_mass, "least_inertia"_a = o.least_inertia,
      "density"_a = o.density, "repair_inertias"_a = o.repair_inertias, "leave_out_foreign"_a = o.leave_out_foreign,
      "colliders"_a = o.colliders, "keyframe"_a = o.keyframe, "body"_a = o.body, "loops"_a = to_string(o.loops),
      "soft"_a = to_string(o.soft), "leave_out_meshes"_a = o.leave_out_meshes, "self_collisions"_a = o.self_collisions,
      "hull_vertices"_a = o.hull_vertices, "fit"_a = to_string(o.fit), "fit_of_links"_a = py::dict(),
      "packages"_a = py::dict(), "file_roots"_a = py::tuple(), "visual_meshes"_a = false, "ignore"_a = py::none(),
      help);
}

void add_file(py::module_& module, const char* name, const char* help, FromFile read) {
  add<const std::filesystem::path&>(
      module, name, help,
      [read](const std::filesystem::path& path, const ImportOptions& options) {
        std::error_code failed;
        if (!std::filesystem::exists(path, failed)) {  // as open() does it
          errno = failed ? failed.value() : ENOENT;
          PyErr_SetFromErrnoWithFilename(PyExc_OSError, path.c_str());
          throw py::error_already_set();
        }
        return read(path.string(), options);
      },
      "path"_a);
}

void add_text(py::module_& module, const char* name, const char* source, FromText read) {
  add<const std::string&, const std::string&>(module, name, "The same from text; `source` names it in errors.", read,
                                              "text"_a, "source"_a = source);
}

void bind_export(py::module_& module) {
  const auto exported = [](const Export& made) {
    return py::module_::import("lockstep.model").attr("Export")(made.text, made.report, made.warnings);
  };
  module.def(
      "export_mjcf",
      [exported](const py::object& model, std::optional<double> timestep) {
        return exported(export_mjcf(model_of(model), {.timestep = timestep}));
      },
      "model"_a, py::kw_only(), "timestep"_a = py::none(),
      "The model as MJCF, MuJoCo's XML: an Export with text, report and warnings. The report names what the format "
      "cannot say. The file asks MuJoCo for steps of `timestep` s, by default those of model.time_step, or 0.001.");
  module.def(
      "export_urdf", [exported](const py::object& model) { return exported(export_urdf(model_of(model))); }, "model"_a,
      "The model as URDF, which has no drives, gravity or start: an Export with text, report and warnings.");
}

}  // namespace

void bind_import(py::module_& module) {
  add_file(
      module, "from_file",
      "Reads a Model from a URDF or MJCF file. model.report says what became of everything in it, model.warnings "
      "what its owner should act on. least_mass, kg, and least_inertia, kg m^2, raise those of lighter bodies. "
      "repair_inertias: impossible inertias become the nearest possible ones. colliders: collision shapes "
      "become colliders, meshes their hulls of at most hull_vertices corners, or what fit, 'hull', 'box', 'capsule' "
      "or 'none', and fit_of_links, by name, say. Mesh files lie in the folder of the file, in packages, folders by "
      "name, or in file_roots. leave_out_meshes: none is opened. visual_meshes: model.visual_meshes are what links "
      "look like, as far as "
      "it is meshes, for recordings and pictures. ignore: bounds that are not judged, as in "
      "compile(). URDF alone: density, "
      "kg/m^3, gives bodies without mass that of their collision shapes; leave_out_foreign leaves out what other "
      "tools add. MJCF alone: keyframe, by name or number, is where the model starts; body is read with what it "
      "carries, and all else is left out; loops is 'keep' or 'leave_out'; soft is 'harden' or 'as_in_file'; "
      "self_collisions=False leaves out pairs of a robot with itself. "
      "An option that the format cannot use is a "
      "SettingsError. Raises ImportFileError, ModelError, FileNotFoundError, too.",
      import_file);
  add_file(module, "from_urdf", "from_file() for URDF alone.", import_urdf_file);
  add_text(module, "from_urdf_text", "URDF text", import_urdf);
  add_file(module, "from_mjcf", "from_file() for MJCF, MuJoCo's XML, alone.", import_mjcf_file);
  add_text(module, "from_mjcf_text", "MJCF text", import_mjcf);
  bind_export(module);
}

}  // namespace lockstep::python
