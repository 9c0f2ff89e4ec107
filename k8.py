exec(open("/tmp/engineer-w/k4.py").read().split("al=2")[0])
g=Polynomial([[0.,1.]])
for n in (120,):
    m=TriangleMesh.rectangle((4,n),1.,1.)
    for gap,f in ((-1e-3,.1),):
        pr=ContactProblem(m,Material(1e3,.3),[Contact("left",f,gap=gap),Contact("right",f,gap=gap),*F0("top","bottom")],body_potential=g)
        t=time.time(); go(f"walls {gap}",pr); print(time.time()-t)
