#include <math.h>
#include <string.h>

#include "grouser/track_net.h"
#include "module.h"

typedef struct {
  grouser_kernel_object base;
  grouser_track_net net;
  void *parameters; /* what the network points into */
} track_net_object;

static PyObject *track_net_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"mode",         "contact",     "wheels",          "mass",        "gravity",     "contact_length",
                          "element_length", "element_spacing", "tread",     "track_width", "cg_height",   "contact_center",
                          "soft_speed",   "activation",  "widths",          "parameters",  "input_mean",  "input_scale",
                          "output_mean",  "output_scale", "ends",           "reach",       "half_travel", "part_length",
                          "mean",         "moment",      NULL};
  grouser_track_net net;
  memset(&net, 0, sizeof net);
  grouser_physics *b = &net.block;
  b->along = b->across = 1;
  int mode, contact, activation;
  PyObject *widths, *bytes, *input_mean, *input_scale, *output_mean, *output_scale, *ends, *reach, *mean, *moment;
  double places[2][GROUSER_POINTS * GROUSER_MAX_WHEELS];
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "iiiddddddddddiOOOOOOOOddOO", names, &mode, &contact,
                                   &b->wheels, &b->mass, &b->gravity, &b->contact_length, &b->element_length,
                                   &b->element_spacing, &b->tread, &b->track_width, &b->cg_height, &b->contact_center,
                                   &b->soft_speed, &activation, &widths, &bytes, &input_mean, &input_scale,
                                   &output_mean, &output_scale, &ends, &reach, &net.half_travel, &net.part_length,
                                   &mean, &moment))
    return NULL;
  if (grouser_read_block(mode, contact, GROUSER_SOFT_PATH, b) < 0) return NULL;
  if (!(b->soft_speed > 0)) {
    PyErr_SetString(PyExc_ValueError, "soft_speed must be positive");
    return NULL;
  }
  void *parameters = grouser_read_dense(activation, widths, bytes, &net.dense);
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
      grouser_copy_doubles(mean, "mean", GROUSER_POINTS * b->wheels, places[0]) < 0 ||
      grouser_copy_doubles(moment, "moment", GROUSER_POINTS * b->wheels, places[1]) < 0)
    goto refused;
  for (int j = 0; j < GROUSER_POINTS; j++)
    for (int i = 0; i < b->wheels; i++) {
      net.mean[i][j] = places[0][j * b->wheels + i];
      net.moment[i][j] = places[1][j * b->wheels + i];
    }
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  track_net_object *self = (track_net_object *)allocate(type, 0);
  if (!self) goto refused;
  self->net = net;
  self->base.kernel = grouser_chosen_level()->track_net(&self->net);
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

static PyMethodDef track_net_methods[] = {GROUSER_KERNEL_METHODS, GROUSER_TRACK_METHODS, {NULL, NULL, 0, NULL}};

static PyGetSetDef track_net_attributes[] = {
    {"kernel", grouser_object_capsule, NULL, "The kernel as a capsule, for other compiled code.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyType_Slot track_net_slots[] = {{Py_tp_new, track_net_new},
                                        {Py_tp_dealloc, track_net_dealloc},
                                        {Py_tp_methods, track_net_methods},
  {Py_tp_getset, track_net_attributes},
                                        {Py_tp_doc, "The structured surrogate: a network for one track's shear."},
                                        {0, NULL}};

static PyType_Spec track_net_spec = {"grouser.native._core.TrackNet", sizeof(track_net_object), 0, Py_TPFLAGS_DEFAULT,
                                     track_net_slots};

int grouser_add_track_net_type(PyObject *module) {
  PyObject *type = PyType_FromModuleAndSpec(module, &track_net_spec, NULL);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "TrackNet", type);
  Py_DECREF(type);
  return status;
}
