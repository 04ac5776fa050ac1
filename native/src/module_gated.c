#include "module.h"

typedef struct {
  grouser_kernel_object base;
  grouser_gated gated;
  PyObject *primary, *fallback; /* whose kernels are called */
} gated_object;

static PyObject *gated_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"primary", "fallback", "detector", NULL};
  PyObject *primary, *fallback, *detector;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "OOO", names, &primary, &fallback, &detector)) return NULL;
  const grouser_kernel *first = grouser_pointer_of(primary, "kernel", GROUSER_KERNEL_CAPSULE);
  const grouser_kernel *second = first ? grouser_pointer_of(fallback, "kernel", GROUSER_KERNEL_CAPSULE) : NULL;
  const grouser_detector *judge = second ? grouser_pointer_of(detector, "detector", GROUSER_DETECTOR_CAPSULE) : NULL;
  if (!judge) return NULL;
  if (first->columns != second->columns || first->columns != judge->columns) {
    PyErr_Format(PyExc_ValueError, "primary, fallback and detector must take the same columns, got %d, %d and %d",
                 first->columns, second->columns, judge->columns);
    return NULL;
  }
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  gated_object *self = (gated_object *)allocate(type, 0);
  if (!self) return NULL;
  self->primary = Py_NewRef(primary);
  self->fallback = Py_NewRef(fallback);
  self->gated.primary = *first;
  self->gated.fallback = *second;
  self->gated.detector = *judge;
  self->base.kernel = grouser_chosen_level()->gated(&self->gated);
  return (PyObject *)self;
}

static void gated_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  Py_XDECREF(((gated_object *)self)->primary);
  Py_XDECREF(((gated_object *)self)->fallback);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static PyMethodDef gated_methods[] = {GROUSER_KERNEL_METHODS, {NULL, NULL, 0, NULL}};

static PyGetSetDef gated_attributes[] = {
    {"kernel", grouser_object_capsule, NULL, "The kernel as a capsule, for other compiled code.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyType_Slot gated_slots[] = {{Py_tp_new, gated_new},
                                    {Py_tp_dealloc, gated_dealloc},
                                    {Py_tp_methods, gated_methods},
                                    {Py_tp_getset, gated_attributes},
                                    {Py_tp_doc, "A surrogate where its detector knows the row, another block elsewhere."},
                                    {0, NULL}};

static PyType_Spec gated_spec = {"grouser.native._core.Gated", sizeof(gated_object), 0, Py_TPFLAGS_DEFAULT, gated_slots};

int grouser_add_gated_type(PyObject *module) {
  PyObject *type = PyType_FromModuleAndSpec(module, &gated_spec, NULL);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "Gated", type);
  Py_DECREF(type);
  return status;
}
