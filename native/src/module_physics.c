#include "grouser/physics.h"
#include "module.h"

typedef struct {
  grouser_kernel_object base;
  grouser_physics block;
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
  static char *names[] = {"mode",           "contact",         "path",  "precision",   "wheels",    "along",     "across",
                          "mass",           "gravity",         "contact_length",       "element_length",
                          "element_spacing", "tread",          "track_width",          "cg_height",
                          "contact_center", "soft_speed",      NULL};
  grouser_physics b;
  int mode, contact, path, precision;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "iiiiiiidddddddddd", names, &mode, &contact, &path, &precision,
                                   &b.wheels,
                                   &b.along, &b.across, &b.mass, &b.gravity, &b.contact_length, &b.element_length,
                                   &b.element_spacing, &b.tread, &b.track_width, &b.cg_height, &b.contact_center, &b.soft_speed))
    return NULL;
  if (grouser_read_block(mode, contact, path, &b) < 0) return NULL;
  if (precision != GROUSER_DOUBLE && (precision != GROUSER_SINGLE || path != GROUSER_SOFT_PATH)) {
    PyErr_SetString(PyExc_ValueError, "precision must be 0 (double), or on the soft path 1 (single)");
    return NULL;
  }
  b.precision = (enum grouser_precision)precision;
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  physics_object *self = (physics_object *)allocate(type, 0);
  if (!self) return NULL;
  self->block = b;
  self->base.kernel = grouser_chosen_level()->physics(&self->block);
  return (PyObject *)self;
}

static void physics_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static PyMethodDef physics_methods[] = {GROUSER_KERNEL_METHODS, GROUSER_TRACK_METHODS, {NULL, NULL, 0, NULL}};

static PyGetSetDef physics_attributes[] = {
    {"kernel", grouser_object_capsule, NULL, "The kernel as a capsule, for other compiled code.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyType_Slot physics_slots[] = {{Py_tp_new, physics_new},
                                      {Py_tp_dealloc, physics_dealloc},
                                      {Py_tp_methods, physics_methods},
  {Py_tp_getset, physics_attributes},
                                      {Py_tp_doc, "The cell-integrated track-terrain block in float64."},
                                      {0, NULL}};

static PyType_Spec physics_spec = {"grouser.native._core.Physics", sizeof(physics_object), 0, Py_TPFLAGS_DEFAULT,
                                   physics_slots};

int grouser_add_physics_type(PyObject *module) {
  PyObject *type = PyType_FromModuleAndSpec(module, &physics_spec, NULL);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "Physics", type);
  Py_DECREF(type);
  return status;
}
