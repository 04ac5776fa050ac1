#include "grouser/physics.h"
#include "module.h"

typedef struct {
  PyObject_HEAD
  grouser_physics block;
  grouser_kernel kernel;
} physics_object;

int grouser_read_block(int mode, int contact, int path, grouser_physics *block) {
  if ((mode != GROUSER_RIGID && mode != GROUSER_SOIL) || (contact != GROUSER_CONTINUOUS && contact != GROUSER_PER_WHEEL) ||
      (path != GROUSER_SOFT_PATH && path != GROUSER_EXACT_PATH)) {
    PyErr_SetString(PyExc_ValueError, "mode, contact and path must be 0 or 1");
    return -1;
  }
  if (block->wheels < 1 || block->wheels > GROUSER_MAX_WHEELS || block->along < 1 ||
      block->along > GROUSER_MAX_CELLS || block->across < 1 || block->across > GROUSER_MAX_CELLS) {
    PyErr_Format(PyExc_ValueError, "wheels must lie in [1, %d], cells along and across in [1, %d]", GROUSER_MAX_WHEELS,
                 GROUSER_MAX_CELLS);
    return -1;
  }
  block->mode = (enum grouser_mode)mode;
  block->contact = (enum grouser_contact)contact;
  block->path = (enum grouser_path)path;
  return 0;
}

static PyObject *physics_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"mode",           "contact",         "path",  "wheels",      "along",     "across",
                          "mass",           "gravity",         "contact_length",       "element_length",
                          "element_spacing", "tread",          "track_width",          "cg_height",
                          "contact_center", "soft_speed",      NULL};
  grouser_physics b;
  int mode, contact, path;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "iiiiiidddddddddd", names, &mode, &contact, &path, &b.wheels,
                                   &b.along, &b.across, &b.mass, &b.gravity, &b.contact_length, &b.element_length,
                                   &b.element_spacing, &b.tread, &b.track_width, &b.cg_height, &b.contact_center, &b.soft_speed))
    return NULL;
  if (grouser_read_block(mode, contact, path, &b) < 0) return NULL;
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  physics_object *self = (physics_object *)allocate(type, 0);
  if (self) self->block = b;
  return (PyObject *)self;
}

static void physics_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static void evaluate(const void *block, const double *x, double *forces, double *jacobian) {
  grouser_physics_forces(block, x, forces, jacobian);
}

static const char *refuses(const void *block, const double *x) { return grouser_physics_refuses(block, x); }

static void evaluate_track(const void *block, const double *x, int side, double *forces, double *jacobian) {
  grouser_physics_track(block, x, (enum grouser_side)side, forces, jacobian);
}

static grouser_kernel kernel_of(PyObject *self) {
  const grouser_physics *block = &((physics_object *)self)->block;
  return (grouser_kernel){block, grouser_columns(block->mode), evaluate, refuses, evaluate_track, NULL};
}

static PyObject *physics_forces(PyObject *self, PyObject *arguments) {
  PyObject *x, *forces;
  if (!PyArg_ParseTuple(arguments, "OO:forces", &x, &forces)) return NULL;
  const grouser_kernel kernel = kernel_of(self);
  return grouser_kernel_call(&kernel, x, forces, NULL);
}

static PyObject *physics_forces_and_jacobian(PyObject *self, PyObject *arguments) {
  PyObject *x, *forces, *jacobian;
  if (!PyArg_ParseTuple(arguments, "OOO:forces_and_jacobian", &x, &forces, &jacobian)) return NULL;
  const grouser_kernel kernel = kernel_of(self);
  return grouser_kernel_call(&kernel, x, forces, jacobian);
}

static PyObject *physics_track_forces(PyObject *self, PyObject *arguments) {
  PyObject *left, *right, *tracks, *jacobian = NULL;
  if (!PyArg_ParseTuple(arguments, "OOO|O:track_forces", &left, &right, &tracks, &jacobian)) return NULL;
  const grouser_kernel kernel = kernel_of(self);
  return grouser_kernel_call_tracks(&kernel, left, right, tracks, jacobian);
}

static PyObject *physics_kernel(PyObject *self, void *unused) {
  (void)unused;
  ((physics_object *)self)->kernel = kernel_of(self);
  return PyCapsule_New(&((physics_object *)self)->kernel, GROUSER_KERNEL_CAPSULE, NULL);
}

static PyGetSetDef physics_attributes[] = {
    {"kernel", physics_kernel, NULL, "The compiled function itself, alive as long as this object.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyMethodDef physics_methods[] = {
    {"forces", physics_forces, METH_VARARGS, "forces(x, forces): write [Qx, Qy, Mz] of every row."},
    {"forces_and_jacobian", physics_forces_and_jacobian, METH_VARARGS,
     "forces_and_jacobian(x, forces, jacobian): write forces and their derivatives by every column."},
    {"track_forces", physics_track_forces, METH_VARARGS,
     "track_forces(x_left, x_right, track_forces[, jacobian]): write [Fx, Fy, M] of each track, and its derivatives by\n"
     "every column of its own input."},
    {NULL, NULL, 0, NULL}};

static PyType_Slot physics_slots[] = {{Py_tp_new, physics_new},
                                      {Py_tp_dealloc, physics_dealloc},
                                      {Py_tp_methods, physics_methods},
                                      {Py_tp_getset, physics_attributes},
                                      {Py_tp_doc, "The cell-integrated track-terrain block in float64."},
                                      {0, NULL}};

static PyType_Spec physics_spec = {"grouser.native._core.Physics", sizeof(physics_object), 0, Py_TPFLAGS_DEFAULT,
                                   physics_slots};

int grouser_add_physics_type(PyObject *module) {
  PyObject *type = PyType_FromSpec(&physics_spec);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "Physics", type);
  Py_DECREF(type);
  return status;
}
