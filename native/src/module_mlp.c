#include <math.h>
#include <string.h>

#include "grouser/mlp.h"
#include "module.h"

typedef struct {
  PyObject_HEAD
  grouser_mlp net;
  float *parameters; /* every layer's weights, then its biases */
  grouser_kernel kernel;
} mlp_object;

static PyObject *mlp_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"activation",  "widths",      "parameters",   "input_mean",
                          "input_scale", "output_mean", "output_scale", NULL};
  int activation;
  PyObject *widths, *bytes, *input_mean, *input_scale, *output_mean, *output_scale;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "iOOOOOO", names, &activation, &widths, &bytes, &input_mean,
                                   &input_scale, &output_mean, &output_scale))
    return NULL;
  grouser_mlp net;
  memset(&net, 0, sizeof net);
  float *parameters = grouser_read_dense(activation, widths, bytes, &net.dense);
  if (!parameters) return NULL;
  const int inputs = net.dense.widths[0], outputs = net.dense.widths[net.dense.layers];
  if (inputs > GROUSER_MAX_COLUMNS || outputs != GROUSER_OUTPUTS) {
    PyErr_Format(PyExc_ValueError, "a network takes at most %d inputs and returns %d outputs", GROUSER_MAX_COLUMNS,
                 GROUSER_OUTPUTS);
    PyMem_Free(parameters);
    return NULL;
  }
  if (grouser_copy_doubles(input_mean, "input_mean", inputs, net.input_mean) < 0 ||
      grouser_copy_doubles(input_scale, "input_scale", inputs, net.input_scale) < 0 ||
      grouser_copy_doubles(output_mean, "output_mean", outputs, net.output_mean) < 0 ||
      grouser_copy_doubles(output_scale, "output_scale", outputs, net.output_scale) < 0) {
    PyMem_Free(parameters);
    return NULL;
  }
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  mlp_object *self = (mlp_object *)allocate(type, 0);
  if (!self) {
    PyMem_Free(parameters);
    return NULL;
  }
  self->net = net;
  self->parameters = parameters;
  return (PyObject *)self;
}

static void mlp_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  PyMem_Free(((mlp_object *)self)->parameters);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static void evaluate(const void *net, const double *x, double *forces, double *jacobian) {
  grouser_mlp_forces(net, x, forces, jacobian);
}

static const char *refuses(const void *self, const double *x) {
  static const char *const rigid[] = {GROUSER_RIGID_COLUMNS}, *const soil[] = {GROUSER_SOIL_COLUMNS};
  const int inputs = ((const grouser_mlp *)self)->dense.widths[0];
  for (int n = 0; n < inputs; n++)
    if (!isfinite(x[n])) return inputs == grouser_columns(GROUSER_RIGID) ? rigid[n] : soil[n];
  return NULL;
}

static grouser_kernel kernel_of(PyObject *self) {
  const grouser_mlp *net = &((mlp_object *)self)->net;
  return (grouser_kernel){net, net->dense.widths[0], evaluate, refuses, NULL, NULL};
}

static PyObject *mlp_forces(PyObject *self, PyObject *arguments) {
  PyObject *x, *forces;
  if (!PyArg_ParseTuple(arguments, "OO:forces", &x, &forces)) return NULL;
  const grouser_kernel kernel = kernel_of(self);
  return grouser_kernel_call(&kernel, x, forces, NULL);
}

static PyObject *mlp_forces_and_jacobian(PyObject *self, PyObject *arguments) {
  PyObject *x, *forces, *jacobian;
  if (!PyArg_ParseTuple(arguments, "OOO:forces_and_jacobian", &x, &forces, &jacobian)) return NULL;
  const grouser_kernel kernel = kernel_of(self);
  return grouser_kernel_call(&kernel, x, forces, jacobian);
}

static PyObject *mlp_kernel(PyObject *self, void *unused) {
  (void)unused;
  ((mlp_object *)self)->kernel = kernel_of(self);
  return PyCapsule_New(&((mlp_object *)self)->kernel, GROUSER_KERNEL_CAPSULE, NULL);
}

static PyGetSetDef mlp_attributes[] = {
    {"kernel", mlp_kernel, NULL, "The compiled function itself, alive as long as this object.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyMethodDef mlp_methods[] = {
    {"forces", mlp_forces, METH_VARARGS, "forces(x, forces): write the network's forces of every row."},
    {"forces_and_jacobian", mlp_forces_and_jacobian, METH_VARARGS,
     "forces_and_jacobian(x, forces, jacobian): write forces and their derivatives by every column."},
    {NULL, NULL, 0, NULL}};

static PyType_Slot mlp_slots[] = {{Py_tp_new, mlp_new},
                                  {Py_tp_dealloc, mlp_dealloc},
                                  {Py_tp_methods, mlp_methods},
                                  {Py_tp_getset, mlp_attributes},
                                  {Py_tp_doc, "A dense float32 network between float64 interface columns and forces."},
                                  {0, NULL}};

static PyType_Spec mlp_spec = {"grouser.native._core.Mlp", sizeof(mlp_object), 0, Py_TPFLAGS_DEFAULT, mlp_slots};

int grouser_add_mlp_type(PyObject *module) {
  PyObject *type = PyType_FromSpec(&mlp_spec);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "Mlp", type);
  Py_DECREF(type);
  return status;
}
