#include <stdlib.h>
#include <string.h>

#include "module.h"

#include "grouser/interface.h"

static const grouser_level *chosen;

const grouser_level *grouser_chosen_level(void) { return chosen; }

/* -1 and an error raised if GROUSER_CPU names a level that was not compiled or that the processor does not have. */
static int choose_level(void) {
  const grouser_level *levels[GROUSER_LEVELS];
  const int count = grouser_levels(levels);
  const char *wanted = getenv("GROUSER_CPU");
  for (int n = 0; n < count; n++)
    if (!wanted || !*wanted || strcmp(wanted, levels[n]->name) == 0) {
      chosen = levels[n];
      return 0;
    }
  PyErr_Format(PyExc_ImportError, "GROUSER_CPU=%s: this build and processor run %s%s%s%s%s", wanted, levels[0]->name,
               count > 1 ? ", " : "", count > 1 ? levels[1]->name : "", count > 2 ? ", " : "",
               count > 2 ? levels[2]->name : "");
  return -1;
}

static PyObject *columns(PyObject *module, PyObject *argument) {
  (void)module;
  static const char *const names[2][GROUSER_MAX_COLUMNS + 1] = {{GROUSER_RIGID_COLUMNS}, {GROUSER_SOIL_COLUMNS}};
  const long mode = PyLong_AsLong(argument);
  if (mode == -1 && PyErr_Occurred()) return NULL;
  if (mode != GROUSER_RIGID && mode != GROUSER_SOIL) {
    PyErr_SetString(PyExc_ValueError, "mode must be 0 (rigid) or 1 (soil)");
    return NULL;
  }
  const Py_ssize_t count = grouser_columns((enum grouser_mode)mode);
  PyObject *result = PyTuple_New(count);
  for (Py_ssize_t n = 0; result && n < count; n++) {
    PyObject *name = PyUnicode_FromString(names[mode][n]);
    if (!name || PyTuple_SetItem(result, n, name) < 0) Py_CLEAR(result);
  }
  return result;
}

static PyObject *cpu_level(PyObject *module, PyObject *unused) {
  (void)module;
  (void)unused;
  return PyUnicode_FromString(chosen->name);
}

static PyMethodDef methods[] = {
    {"columns", columns, METH_O, "columns(mode): interface column names as the C core orders them."},
    {"cpu_level", cpu_level, METH_NOARGS, "cpu_level(): the vector level that the kernels run at."},
    {NULL, NULL, 0, NULL}};

static int execute(PyObject *module) {
  int (*const add[])(PyObject *) = {grouser_add_bound_type, grouser_add_physics_type,  grouser_add_mlp_type,   grouser_add_track_net_type,
                                    grouser_add_gated_type, grouser_add_detector_type, grouser_add_field_type, grouser_add_fleet_type,
                                    grouser_add_rules_types, grouser_add_episodes_type};
  if (choose_level() < 0) return -1;
  for (size_t n = 0; n < sizeof add / sizeof *add; n++)
    if (add[n](module) < 0) return -1;
  return 0;
}

static PyModuleDef_Slot slots[] = {{Py_mod_exec, execute}, {0, NULL}};

static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_core", "The C core of grouser.", 0, methods, slots,
                                        NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__core(void) { return PyModuleDef_Init(&definition); }
