#include "grouser/physics.h"
#include "module.h"

typedef struct {
  PyObject_HEAD
  grouser_physics block;
} physics_object;

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
  if ((mode != GROUSER_RIGID && mode != GROUSER_SOIL) || (contact != GROUSER_CONTINUOUS && contact != GROUSER_PER_WHEEL) ||
      (path != GROUSER_SOFT_PATH && path != GROUSER_EXACT_PATH)) {
    PyErr_SetString(PyExc_ValueError, "mode, contact and path must be 0 or 1");
    return NULL;
  }
  if (b.wheels < 1 || b.wheels > GROUSER_MAX_WHEELS || b.along < 1 || b.along > GROUSER_MAX_CELLS || b.across < 1 ||
      b.across > GROUSER_MAX_CELLS) {
    PyErr_Format(PyExc_ValueError, "wheels must lie in [1, %d], cells along and across in [1, %d]", GROUSER_MAX_WHEELS,
                 GROUSER_MAX_CELLS);
    return NULL;
  }
  b.mode = (enum grouser_mode)mode;
  b.path = (enum grouser_path)path;
  b.contact = (enum grouser_contact)contact;
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

static grouser_kernel kernel_of(PyObject *self) {
  const grouser_physics *block = &((physics_object *)self)->block;
  return (grouser_kernel){block, grouser_columns(block->mode), evaluate, refuses};
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

static void evaluate_tracks(const grouser_physics *block, const grouser_array *left, const grouser_array *right,
                            double *tracks, double *jacobian) {
  const int columns = grouser_columns(block->mode);
  const Py_ssize_t entries = GROUSER_OUTPUTS * columns;
  for (Py_ssize_t row = 0; row < left->rows; row++, tracks += 2 * GROUSER_OUTPUTS) {
    double *slopes = jacobian ? jacobian + 2 * row * entries : NULL;
    grouser_physics_track(block, left->data + row * columns, GROUSER_LEFT, tracks, slopes);
    grouser_physics_track(block, right->data + row * columns, GROUSER_RIGHT, tracks + GROUSER_OUTPUTS,
                          slopes ? slopes + entries : NULL);
  }
}

static PyObject *physics_track_forces(PyObject *self, PyObject *arguments) {
  const grouser_physics *block = &((physics_object *)self)->block;
  const grouser_kernel kernel = kernel_of(self);
  const int columns = kernel.columns;
  PyObject *left_object, *right_object, *tracks_object, *jacobian_object = NULL, *result = NULL;
  grouser_array left, right, tracks, jacobian = {.data = NULL};
  if (!PyArg_ParseTuple(arguments, "OOO|O:track_forces", &left_object, &right_object, &tracks_object, &jacobian_object))
    return NULL;
  if (grouser_array_acquire(left_object, "x_left", columns, 0, &left) < 0) return NULL;
  if (grouser_array_acquire(right_object, "x_right", columns, 0, &right) < 0) goto release_left;
  if (grouser_array_acquire(tracks_object, "track_forces", 2 * GROUSER_OUTPUTS, 1, &tracks) < 0) goto release_right;
  if (jacobian_object &&
      grouser_array_acquire(jacobian_object, "jacobian", 2 * GROUSER_OUTPUTS * columns, 1, &jacobian) < 0)
    goto release_tracks;
  if (grouser_same_rows(&left, &right, "x_right") && grouser_same_rows(&left, &tracks, "track_forces") &&
      (!jacobian_object || grouser_same_rows(&left, &jacobian, "jacobian")) &&
      !grouser_kernel_refuses(&kernel, &left) && !grouser_kernel_refuses(&kernel, &right)) {
    if (left.rows >= GROUSER_BATCH_ROWS) {
      Py_BEGIN_ALLOW_THREADS
      evaluate_tracks(block, &left, &right, tracks.data, jacobian.data);
      Py_END_ALLOW_THREADS
    } else {
      evaluate_tracks(block, &left, &right, tracks.data, jacobian.data);
    }
    result = Py_NewRef(Py_None);
  }
  if (jacobian_object) grouser_array_release(&jacobian);
release_tracks:
  grouser_array_release(&tracks);
release_right:
  grouser_array_release(&right);
release_left:
  grouser_array_release(&left);
  return result;
}

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
