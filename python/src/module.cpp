// The extension module _lockstep. lockstep/__init__.py shows what is public. SPDX-License-Identifier: Apache-2.0
#include <dlfcn.h>

#include <filesystem>
#include <set>

#include "batch.h"

namespace lockstep::python {
namespace {

// pybind11 works in one interpreter of a process. Another one copies the module without initialising it, so the package
// asks, by a function that is not pybind11's.
PyObject* require_main_interpreter(PyObject*, PyObject*) {
  if (PyInterpreterState_Get() == PyInterpreterState_Main()) Py_RETURN_NONE;
  PyErr_SetString(PyExc_ImportError, "lockstep works in the main interpreter only; use threads or processes");
  return nullptr;
}

PyMethodDef requirement = {"_require_main_interpreter", require_main_interpreter, METH_NOARGS,
                           "Raises ImportError in a sub-interpreter."};

void load_kernel(const std::string& path) {
  static std::set<void*> loaded;
  const char* const remedy = "build it as a shared library with lockstep_add_kernel() of the same version";
  const bool is_there = path.find('/') != std::string::npos && std::filesystem::exists(path);
  if (path.empty() || (is_there && !std::filesystem::is_regular_file(path)))
    throw UsageError("kernel '" + path + "'", "is no regular file", "name the shared library that was built");
  const int before = registered_kernels();
  void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_GLOBAL);
  if (!library) throw UsageError("kernel '" + path + "'", std::string("cannot be loaded: ") + dlerror(), remedy);
  if (registered_kernels() > before) loaded.insert(library);
  if (!loaded.count(library)) throw UsageError("kernel '" + path + "'", "brings no generated kernel", remedy);
}

}  // namespace

PYBIND11_MODULE(_lockstep, module) {
  translate_errors();
  module.attr("__version__") = version();
  bind_batch(module);
  bind_plan(module);
  bind_import(module);
  bind_ranks(module);
  bind_step_draws(module);
  bind_view(module);
  module.attr("_require_main_interpreter") = py::reinterpret_steal<py::object>(PyCFunction_New(&requirement, nullptr));
  module.def(
      "load_kernel", &load_kernel, py::arg("path"),
      "Loads generated kernels from a shared library. Batches that are made later use those of their plan. Raises "
      "UsageError where that cannot be loaded, or brings no kernel.");
}

}  // namespace lockstep::python
