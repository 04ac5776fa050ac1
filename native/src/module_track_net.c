#include <math.h>
#include <string.h>

#include "grouser/track_net.h"
#include "module.h"

typedef struct {
  PyObject_HEAD
  grouser_track_net net;
  float *parameters; /* every layer's weights, then its biases */
  grouser_kernel kernel;
} track_net_object;

static PyObject *track_net_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"mode",         "contact",     "wheels",          "mass",        "gravity",     "contact_length",
                          "element_length", "element_spacing", "tread",     "track_width", "cg_height",   "contact_center",
                          "soft_speed",   "activation",  "widths",          "parameters",  "input_mean",  "input_scale",
                          "output_mean",  "output_scale", "ends",           "reach",       "half_travel", "part_length",
                          "weights",      NULL};
  grouser_track_net net;
  memset(&net, 0, sizeof net);
  grouser_physics *b = &net.block;
  b->along = b->across = 1;
  int mode, contact, activation;
  PyObject *widths, *bytes, *input_mean, *input_scale, *output_mean, *output_scale, *ends, *reach, *weights;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "iiiddddddddddiOOOOOOOOddO", names, &mode, &contact,
                                   &b->wheels, &b->mass, &b->gravity, &b->contact_length, &b->element_length,
                                   &b->element_spacing, &b->tread, &b->track_width, &b->cg_height, &b->contact_center,
                                   &b->soft_speed, &activation, &widths, &bytes, &input_mean, &input_scale,
                                   &output_mean, &output_scale, &ends, &reach, &net.half_travel, &net.part_length,
                                   &weights))
    return NULL;
  if (grouser_read_block(mode, contact, GROUSER_SOFT_PATH, b) < 0) return NULL;
  if (!(b->soft_speed > 0)) {
    PyErr_SetString(PyExc_ValueError, "soft_speed must be positive");
    return NULL;
  }
  float *parameters = grouser_read_dense(activation, widths, bytes, &net.dense);
  if (!parameters) return NULL;
  const int units = 3 * b->wheels;
  if (net.dense.widths[0] != GROUSER_FEATURES || net.dense.widths[net.dense.layers] != units) {
    PyErr_Format(PyExc_ValueError, "a network of %d wheels takes %d features and returns %d units", b->wheels,
                 GROUSER_FEATURES, units);
    goto refused;
  }
  if (grouser_copy_doubles(input_mean, "input_mean", GROUSER_FEATURES, net.input_mean) < 0 ||
      grouser_copy_doubles(input_scale, "input_scale", GROUSER_FEATURES, net.input_scale) < 0 ||
      grouser_copy_doubles(output_mean, "output_mean", units, net.output_mean) < 0 ||
      grouser_copy_doubles(output_scale, "output_scale", units, net.output_scale) < 0 ||
      grouser_copy_doubles(ends, "ends", 2 * GROUSER_POINTS, net.ends) < 0 ||
      grouser_copy_doubles(reach, "reach", GROUSER_POINTS, net.reach) < 0 ||
      grouser_copy_doubles(weights, "weights", GROUSER_SHEAR * units, net.weights) < 0)
    goto refused;
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  track_net_object *self = (track_net_object *)allocate(type, 0);
  if (!self) goto refused;
  self->net = net;
  self->parameters = parameters;
  return (PyObject *)self;
refused:
  PyMem_Free(parameters);
  return NULL;
}

static void track_net_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  PyMem_Free(((track_net_object *)self)->parameters);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static void evaluate(const void *net, const double *x, double *forces, double *jacobian) {
  grouser_track_net_forces(net, x, forces, jacobian);
}

static void evaluate_track(const void *net, const double *x, int side, double *forces, double *jacobian) {
  grouser_track_net_track(net, x, (enum grouser_side)side, forces, jacobian);
}

static const char *refuses(const void *net, const double *x) {
  return grouser_physics_refuses(&((const grouser_track_net *)net)->block, x);
}

static grouser_kernel kernel_of(PyObject *self) {
  const grouser_track_net *net = &((track_net_object *)self)->net;
  return (grouser_kernel){net, grouser_columns(net->block.mode), evaluate, refuses, evaluate_track, NULL};
}

static PyObject *track_net_forces(PyObject *self, PyObject *arguments) {
  PyObject *x, *forces;
  if (!PyArg_ParseTuple(arguments, "OO:forces", &x, &forces)) return NULL;
  const grouser_kernel kernel = kernel_of(self);
  return grouser_kernel_call(&kernel, x, forces, NULL);
}

static PyObject *track_net_forces_and_jacobian(PyObject *self, PyObject *arguments) {
  PyObject *x, *forces, *jacobian;
  if (!PyArg_ParseTuple(arguments, "OOO:forces_and_jacobian", &x, &forces, &jacobian)) return NULL;
  const grouser_kernel kernel = kernel_of(self);
  return grouser_kernel_call(&kernel, x, forces, jacobian);
}

static PyObject *track_net_track_forces(PyObject *self, PyObject *arguments) {
  PyObject *left, *right, *tracks, *jacobian = NULL;
  if (!PyArg_ParseTuple(arguments, "OOO|O:track_forces", &left, &right, &tracks, &jacobian)) return NULL;
  const grouser_kernel kernel = kernel_of(self);
  return grouser_kernel_call_tracks(&kernel, left, right, tracks, jacobian);
}

static PyObject *track_net_kernel(PyObject *self, void *unused) {
  (void)unused;
  ((track_net_object *)self)->kernel = kernel_of(self);
  return PyCapsule_New(&((track_net_object *)self)->kernel, GROUSER_KERNEL_CAPSULE, NULL);
}

static PyGetSetDef track_net_attributes[] = {
    {"kernel", track_net_kernel, NULL, "The compiled function itself, alive as long as this object.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyMethodDef track_net_methods[] = {
    {"forces", track_net_forces, METH_VARARGS, "forces(x, forces): write [Qx, Qy, Mz] of every row."},
    {"forces_and_jacobian", track_net_forces_and_jacobian, METH_VARARGS,
     "forces_and_jacobian(x, forces, jacobian): write forces and their derivatives by every column."},
    {"track_forces", track_net_track_forces, METH_VARARGS,
     "track_forces(x_left, x_right, track_forces[, jacobian]): write [Fx, Fy, M] of each track, and its derivatives by\n"
     "every column of its own input."},
    {NULL, NULL, 0, NULL}};

static PyType_Slot track_net_slots[] = {{Py_tp_new, track_net_new},
                                        {Py_tp_dealloc, track_net_dealloc},
                                        {Py_tp_methods, track_net_methods},
                                        {Py_tp_getset, track_net_attributes},
                                        {Py_tp_doc, "The structured surrogate: a network for one track's shear."},
                                        {0, NULL}};

static PyType_Spec track_net_spec = {"grouser.native._core.TrackNet", sizeof(track_net_object), 0, Py_TPFLAGS_DEFAULT,
                                     track_net_slots};

int grouser_add_track_net_type(PyObject *module) {
  PyObject *type = PyType_FromSpec(&track_net_spec);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "TrackNet", type);
  Py_DECREF(type);
  return status;
}
