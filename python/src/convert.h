// Models, settings and errors between C++ and Python. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/numpy.h>

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

/// The array, or what NumPy makes of it. Throws TypeError for None and other objects, which NumPy would take for NaN.
/// `argument` names it.
inline py::array plain_numbers(const py::object& given, const char* argument) {
  const py::array plain = py::module_::import("numpy").attr("asarray")(given);
  if (std::string_view("biuf").find(plain.dtype().kind()) == std::string_view::npos && plain.size() > 0)
    throw py::type_error(std::string(argument) + " holds what is no number: " + text_of(plain.dtype()));
  return plain;
}

/// The same as a new array of this type.
template <class S>
py::array_t<S> array_of(const py::object& given, const char* argument) {
  return py::module_::import("numpy").attr("array")(plain_numbers(given, argument),
                                                    py::arg("dtype") = py::dtype::of<S>());
}

/// Makes `__new__` of a class raise TypeError: what it would make is no object of the library. Objects come from
/// functions.
template <class Class>
void forbid_new(Class& own) {
  reinterpret_cast<PyTypeObject*>(own.ptr())->tp_new = [](PyTypeObject* type, PyObject*, PyObject*) -> PyObject* {
    PyErr_Format(PyExc_TypeError, "%s has no constructor", type->tp_name);
    return nullptr;
  };
}

/// Makes a class with a constructor call it where objects are made, so that none is without a value: `__new__` alone
/// raises TypeError.
template <class Class>
void construct_in_new(Class& own) {
  static newfunc make;  // of this class alone
  static initproc construct;
  auto* const type = reinterpret_cast<PyTypeObject*>(own.ptr());
  make = type->tp_new, construct = type->tp_init;
  type->tp_new = [](PyTypeObject* of, PyObject* args, PyObject* names) -> PyObject* {
    PyObject* const made = make(of, args, names);
    if (!made || construct(made, args, names) == 0) return made;
    Py_DECREF(made);
    return nullptr;
  };
  type->tp_init = [](PyObject*, PyObject*, PyObject*) { return 0; };
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
