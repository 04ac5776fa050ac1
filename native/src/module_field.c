#include <math.h>

#include "grouser/ground.h"
#include "module.h"

typedef struct {
  PyObject_HEAD
  grouser_field field;
  grouser_array theta, height; /* data is NULL where nothing is held */
} field_object;

static int shape_is_possible(int rows, int columns, int parameters, double x, double y, double spacing) {
  enum { MOST = 1 << 28 };
  if (rows < 1 || columns < 1 || rows > MOST / columns) {
    PyErr_Format(PyExc_ValueError, "rows and columns must be at least 1 and rows x columns at most %d", MOST);
  } else if (parameters < 1 || parameters > GROUSER_MAX_PARAMETERS) {
    PyErr_Format(PyExc_ValueError, "parameters must lie in [1, %d], got %d", GROUSER_MAX_PARAMETERS, parameters);
  } else if (!(isfinite(x) && isfinite(y) && isfinite(spacing) && spacing > 0)) {
    PyErr_SetString(PyExc_ValueError, "x, y and spacing must be finite and spacing positive");
  } else {
    return 1;
  }
  return 0;
}

static PyObject *field_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"rows", "columns", "parameters", "x", "y", "spacing", "extend", "theta", "height", NULL};
  grouser_field field = {0};
  PyObject *theta, *height = Py_None;
  int extend;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "iiidddpO|O", names, &field.rows, &field.columns,
                                   &field.parameters, &field.x, &field.y, &field.spacing, &extend, &theta, &height))
    return NULL;
  if (!shape_is_possible(field.rows, field.columns, field.parameters, field.x, field.y, field.spacing)) return NULL;
  field.outside = extend ? GROUSER_EXTEND : GROUSER_REFUSE;
  const Py_ssize_t cells = ((Py_ssize_t)field.rows + 2) * ((Py_ssize_t)field.columns + 2);
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  field_object *self = (field_object *)allocate(type, 0);
  if (!self) return NULL;
  if (grouser_array_acquire(theta, "theta", field.parameters, 0, &self->theta) < 0) goto refused;
  if (height != Py_None && grouser_array_acquire(height, "height", 1, 0, &self->height) < 0) goto refused;
  if (self->theta.rows != cells || (self->height.data && self->height.rows != cells)) {
    PyErr_Format(PyExc_ValueError, "theta and height must hold %zd cells, the outermost ones once again around them",
                 cells);
    goto refused;
  }
  field.theta = self->theta.data;
  field.height = self->height.data;
  self->field = field;
  return (PyObject *)self;
refused:
  Py_DECREF((PyObject *)self);
  return NULL;
}

static void field_dealloc(PyObject *object) {
  field_object *self = (field_object *)object;
  PyTypeObject *type = Py_TYPE(object);
  if (self->theta.data) grouser_array_release(&self->theta);
  if (self->height.data) grouser_array_release(&self->height);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static PyObject *field_capsule(PyObject *self, void *unused) {
  (void)unused;
  return PyCapsule_New(&((field_object *)self)->field, GROUSER_FIELD_CAPSULE, NULL);
}

static PyGetSetDef field_attributes[] = {
    {"field", field_capsule, NULL, "The compiled field itself, alive as long as this object.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyType_Slot field_slots[] = {{Py_tp_new, field_new},
                                    {Py_tp_dealloc, field_dealloc},
                                    {Py_tp_getset, field_attributes},
                                    {Py_tp_doc, "Terrain parameters, and heights if there are any, on a regular grid."},
                                    {0, NULL}};

static PyType_Spec field_spec = {"grouser.native._core.Field", sizeof(field_object), 0, Py_TPFLAGS_DEFAULT, field_slots};

int grouser_add_field_type(PyObject *module) {
  PyObject *type = PyType_FromSpec(&field_spec);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "Field", type);
  Py_DECREF(type);
  return status;
}
