// Models, settings and errors between C++ and Python. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

#include <lockstep/lockstep.h>

namespace lockstep::python {

namespace py = pybind11;

/// str() of a Python object.
inline std::string text_of(const py::handle& thing) { return py::str(thing).cast<std::string>(); }

/// True and False, of Python or numpy.
inline bool is_bool(const py::handle& thing) {
  return py::isinstance<py::bool_>(thing) || text_of(py::type::of(thing).attr("__name__")) == "bool_";
}
inline bool truth_of(const py::handle& thing) { return PyObject_IsTrue(thing.ptr()) == 1; }

/// Names of values, such as enumerators, as Python has them.
template <class Value>
using Names = std::vector<std::pair<const char*, Value>>;

/// The value of that name; throws a Failure that lists all names.
template <class Failure, class Value>
Value one_of(const char* setting, const std::string& name, const Names<Value>& all) {
  std::string names;
  for (const auto& [known, value] : all) {
    if (name == known) return value;
    names += (names.empty() ? "" : ", ") + std::string(known);
  }
  throw Failure(std::string(setting) + " '" + name + "'", "is unknown", "give one of: " + names);
}

/// A value of an argument; throws TypeError that names it.
template <class Value>
Value value_of(const py::handle& given, const char* argument) {
  try {
    return given.cast<Value>();
  } catch (const py::cast_error&) {
    throw py::type_error(std::string(argument) + " cannot be " + text_of(py::repr(given)));
  }
}

/// A lockstep.Model from its Python class. Throws TypeError that names the attribute where a type does not fit.
Model model_of(const py::handle& model);
py::object to_python(const Model& model);

/// The value of that name; throws SettingsError that lists the names.
Method method_of(const std::string& name);
Integrator integrator_of(const std::string& name);
Target target_of(const std::string& name);
Engine engine_of(const std::string& name);
Loops loops_of(const std::string& name);
Fit fit_of(const std::string& name);
Soft soft_of(const std::string& name);
Parameter parameter_of(const std::string& name);
ContactSettings contact_settings_of(const std::string& name);

/// Exceptions of lockstep become those of lockstep/errors.py.
void translate_errors();

}  // namespace lockstep::python
